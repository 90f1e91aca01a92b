"""Blocks in three dimensions, quadratic elements: sag, pull and vibration of clamped ones."""
import numpy as np
import skfem
from scipy.sparse.linalg import eigsh, splu

from references.neo_hookean import Solid, lame, newton, solve


def nodes(length, count, low, high):
    """`count` elements on [0, length], crowded towards an end where it is flagged."""
    t = np.linspace(0, 1, count + 1)
    if low and high:
        t = 0.5 * (1 - np.cos(np.pi * t)) * 0.6 + 0.4 * t
    elif low:
        t = 0.6 * t ** 1.8 + 0.4 * t
    elif high:
        t = 1 - (0.6 * (1 - t) ** 1.8 + 0.4 * (1 - t))
    return length * t


def crowded(length, count, low, high, power=3):
    """The same, ever smaller towards these ends, as by a power: for what is singular there."""
    t = np.linspace(0, 1, count + 1)
    if low and high:
        t = np.where(t < 0.5, 0.5 * (2 * t) ** power, 1 - 0.5 * (2 * (1 - t)) ** power)
    elif low:
        t = t ** power
    elif high:
        t = 1 - (1 - t) ** power
    return length * t


def cut_mesh(mesh, x, z):
    """The mesh with corners of their own for elements on either side of a cut, which ends between corners at z."""
    p, t = mesh.p, mesh.t.copy()
    at = np.nonzero((np.abs(p[0] - x) < 1e-9) & (p[2] > z + 1e-9))[0]
    twin = np.arange(p.shape[1])
    twin[at] = p.shape[1] + np.arange(len(at))
    beyond = p[0][t].mean(axis=0) > x
    t[:, beyond] = twin[t[:, beyond]]
    return skfem.MeshHex(np.hstack([p, p[:, at]]), t)


class Block:
    """[x, y, z] in given node planes; `held` are (axis, place, components) that do not move; `cut` is (x, z): where the
    plane at x is cut from above down to z. `bend` moves the mesh's corners first; where `axis` is a function, held is where
    that is `place`."""

    def __init__(self, planes, young, poisson, held, body_force=None, cut=None, bend=None):
        self.lam, self.mu = lame(young, poisson)
        self.mesh = skfem.MeshHex.init_tensor(*planes)
        if cut is not None:
            self.mesh = cut_mesh(self.mesh, *cut)
        if bend is not None:
            self.mesh = skfem.MeshHex(bend(self.mesh.p), self.mesh.t)
        self.basis = skfem.Basis(self.mesh, skfem.ElementVector(skfem.ElementHex2()), intorder=4)
        self.solid = Solid(self.basis, lambda x, g, v: g, lambda x: 1.0, self.lam, self.mu, body_force)
        fixed = [self.dofs(axis, at, components) for axis, at, components in held]
        self.free = np.setdiff1d(np.arange(self.basis.N), np.concatenate(fixed) if fixed else [])
        self.u = np.zeros(self.basis.N)

    def dofs(self, axis, at, components):
        place = axis if callable(axis) else lambda x: x[axis]
        d = self.basis.get_dofs(lambda x: np.abs(place(x) - at) < 1e-9)
        return np.concatenate([d.all(['u^%d' % (c + 1)]) for c in components])

    def value(self, place, component, beyond=None):
        """Displacement of a corner or middle of an element [m]; at a cut that of the elements on the side of x where
        `beyond` lies."""
        near = np.linalg.norm(self.basis.doflocs.T - np.asarray(place), axis=1) < 1e-9
        elements = np.arange(self.mesh.nelements)
        if beyond is not None:
            middle = self.mesh.p[0][self.mesh.t].mean(axis=0)
            elements = elements[(middle > place[0]) == (beyond > place[0])]
        own = self.basis.get_dofs(elements=elements).all(['u^%d' % (component + 1)])
        return float(self.u[np.intersect1d(np.nonzero(near)[0], own)[0]])

    def solve(self, load_steps=1, prescribe=None):
        full = self.solid.load.copy()
        scale = max(np.abs(full).sum(), self.mu * 1e-4)
        for step in range(1, load_steps + 1):
            self.solid.load = full * step / load_steps
            if prescribe is not None:
                dofs, value = prescribe
                move = np.zeros(self.basis.N)
                move[dofs] = value * step / load_steps - self.u[dofs]
                K = self.solid.stiffness(self.u)  # the rest follows at first as if it were linear
                move[self.free] = solve(K[self.free][:, self.free], -(K @ move)[self.free])
                self.u += move
            self.u = newton(self.solid.forces, self.solid.stiffness, self.u, self.free, scale)
        return self

    def follow(self, loads):
        """The load times each of these in turn; yields each."""
        full, last, before = self.solid.load.copy(), 0.0, None
        for load in loads:
            self.solid.load = load * full
            guess = self.u if before is None else self.u + (load - last) * before
            u = newton(self.solid.forces, self.solid.stiffness, guess, self.free, np.abs(full).sum())
            before = (u - self.u) / (load - last)
            self.u, last = u, load
            yield load

    def solve_small(self):
        """The load in the limit of small displacements."""
        K = self.solid.stiffness(0 * self.u)[self.free][:, self.free].tocsc()
        lu = splu(K, permc_spec='MMD_AT_PLUS_A', options={'SymmetricMode': True}, diag_pivot_thresh=0.001)
        self.u[self.free] = lu.solve(self.solid.load[self.free])

    def frequencies(self, density, count=1, shift=0):
        """The lowest ones [Hz], in rising order; `shift` [Hz] above 0 for a body that is free, whose stiffness is singular."""
        K = self.solid.stiffness(0 * self.u)[self.free][:, self.free]
        M = self.solid.mass(density)[self.free][:, self.free]
        values = eigsh(K, k=count, M=M, sigma=-(2 * np.pi * shift) ** 2, which='LM', return_eigenvectors=False)
        return sorted(float(f) for f in np.sqrt(np.maximum(values, 0)) / (2 * np.pi))
