"""Tissue that is bonded at its bottom and indented from above, quadratic elements: a cylinder on its axis, a slab along a line."""
import numpy as np
import skfem
from scipy.sparse import coo_matrix

from references.neo_hookean import Solid, lame, newton, solve


def graded(points, counts, powers):
    """Nodes on an interval in stretches: `counts` elements each, crowded to either side by `powers`."""
    nodes = [points[0]]
    for a, b, n, p in zip(points, points[1:], counts, powers):
        t = np.arange(1, n + 1) / n
        t = t ** p if p >= 1 else 1 - (1 - t) ** (1 / p)
        nodes.extend(a + (b - a) * t)
    return np.array(nodes)


class RoundedPunch:
    """A flat disc of radius `flat` whose rim is rounded with radius `edge`; with flat = 0, a ball."""

    def __init__(self, flat, edge):
        self.flat, self.edge = flat, edge

    def gap(self, r, z, tip):
        """Distance, its gradient and its Hessian in (r, z); the lowest place is at height `tip`."""
        cr = np.minimum(r, self.flat)
        dr, dz = r - cr, z - (tip + self.edge)
        length = np.hypot(dr, dz)
        n = np.array([dr, dz]) / length
        curved = np.where(r > self.flat, 1.0, 0.0)  # on the disc the normal stays
        if self.flat == 0:
            curved = np.ones_like(r)
        t = np.array([-n[1], n[0]])
        return length - self.edge, n, curved / length * t[:, None] * t[None, :]


class Edge(RoundedPunch):
    """A blade's: a round of radius `edge`, above whose middle its flats go up."""

    def __init__(self, edge):
        super().__init__(0, edge)

    def gap(self, r, z, tip):
        distance, n, H = super().gap(r, np.minimum(z, tip + self.edge), tip)
        return distance, n, np.where(z < tip + self.edge, H, 0)


def descend(forces, stiffness, u, free, scale):
    """As newton(), down to where contact at single points opens and closes from step to step."""
    r = forces(u)[free]
    for _ in range(80):
        if np.abs(r).max() < 1e-6 * scale:
            return u
        falls = False
        for exact in (True, False):
            step = solve(stiffness(u, exact)[free][:, free], -r)
            for length in 0.5 ** np.arange(10):
                trial = u.copy()
                trial[free] += length * step
                new = forces(trial)[free]
                falls = np.isfinite(new).all() and np.linalg.norm(new) < np.linalg.norm(r) * (1 - 1e-4 * length)
                if falls:
                    break
            if falls:
                break
        if not falls:
            break
        u, r = trial, new
    if np.abs(r).max() < 1e-3 * scale:
        return u
    raise RuntimeError('no equilibrium: %g of %g' % (np.abs(r).max(), scale))


def indent(level, radius, height, punch, contact, depths, young, poisson, plane=False):
    """Forces on the frictionless punch at `depths` [N]; `contact` is about how far it touches [m]. Where `plane`, of a slab
    twice `radius` wide in plane strain [N/m]."""
    lam, mu = lame(young, poisson)
    n = level
    # elements crowd towards the rim of the contact and towards the surface
    r = graded([0, contact, 2 * contact, radius], [6 * n, 5 * n, 5 * n], [0.75, 1.15, 1.6])
    z = -graded([0, contact, height], [6 * n, 5 * n], [1.15, 1.3])[::-1]
    if plane:  # where the edge's sides begin is not known before
        r = graded([0, contact, 4 * contact, radius], [8 * n, 6 * n, 8 * n], [1, 1.2, 1.8])
        z = -graded([0, contact, 4 * contact, height], [6 * n, 5 * n, 8 * n], [1, 1.2, 1.8])[::-1]
    z[-1] = 0
    mesh = skfem.MeshQuad.init_tensor(r, z)
    element = skfem.ElementVector(skfem.ElementQuad2())
    basis = skfem.Basis(mesh, element, intorder=5)

    def gradient(x, g, v):
        F = np.zeros((3, 3) + g.shape[2:])
        F[0, 0], F[0, 2], F[2, 0], F[2, 2] = g[0, 0], g[0, 1], g[1, 0], g[1, 1]
        F[1, 1] = 0 if plane else v[0] / x[0]
        return F

    def around(x):
        return np.full_like(x[0], 2) if plane else 2 * np.pi * x[0]

    solid = Solid(basis, gradient, around, lam, mu)
    top = skfem.FacetBasis(mesh, element, facets=mesh.facets_satisfying(lambda x: x[1] > -1e-9), intorder=9)
    dofs, X = top.element_dofs, top.global_coordinates().value
    N = np.array([top.basis[k][0].value for k in range(top.Nbfun)])
    dA = top.dx * around(X)
    # rounds off the corner of max(0, p), so that Newton's method does not cycle
    smooth = (2e-2 if plane else 2e-3) * young
    stiff = (160 if plane else 10) * (lam + 2 * mu) / contact
    fixed = np.unique(np.concatenate([basis.get_dofs(lambda x: x[1] < -height + 1e-9).all(),
                                      basis.get_dofs(lambda x: x[0] < 1e-12).all(['u^1'])]))
    free = np.setdiff1d(np.arange(basis.N), fixed)
    u = np.zeros(basis.N)
    result, pressure, tip = [], np.zeros_like(dA), 0.0
    steps = np.unique(np.concatenate([np.linspace(0, max(depths), 21)[1:], depths]))
    if plane:
        steps = depths
    before, last = np.zeros_like(u), 0.0
    for depth in steps:
        tip = -depth
        if last > 0:  # goes on as it did
            u, before = u + (u - before) * (depth - last) / (last - earlier), u
        earlier, last = last, depth

        def contact_terms(u):
            x = X + np.einsum('kieq,ke->ieq', N, u[dofs])
            g, n, H = punch.gap(np.abs(x[0]), x[1], tip)
            wanted = pressure - stiff * g
            root = np.sqrt(wanted ** 2 + smooth ** 2)
            return 0.5 * (wanted + root), n, H, 0.5 * stiff * (1 + wanted / root)

        def forces(u):
            p, n, _, _ = contact_terms(u)
            f = solid.forces(u)
            np.add.at(f, dofs, -np.einsum('kieq,ieq,eq->ke', N, n, p * dA))
            return f

        def stiffness(u, exact):
            p, n, H, k = contact_terms(u)
            D = (k * n[:, None] * n[None, :] - (p * H if exact else 0)) * dA
            K = np.einsum('kieq,ijeq,ljeq->kle', N, D, N)
            rows = np.broadcast_to(dofs[:, None], K.shape)
            cols = np.broadcast_to(dofs[None], K.shape)
            return solid.stiffness(u) + coo_matrix((K.ravel(), (rows.ravel(), cols.ravel())),
                                                   (basis.N, basis.N)).tocsc()

        scale = young * contact ** (1 if plane else 2)
        for _ in range(8 if depth in depths and not plane else 1):  # augmented Lagrangian: what the penalty hides goes
            u = (descend if plane else newton)(forces, stiffness, u, free, scale)
            carried, n, _, _ = contact_terms(u)
            if not plane:
                pressure = carried
        if depth in depths:
            result.append(float(np.sum(-carried * n[1] * dA)))
    return result
