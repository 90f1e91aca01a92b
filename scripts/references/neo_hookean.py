"""The package's neo-Hookean law (src/material/laws.h, without the log term) and Newton's method for it."""
import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import splu

try:
    import pypardiso  # several times as fast as splu in three dimensions
except ImportError:
    pypardiso = None


def solve(K, b):
    if pypardiso is not None:
        return pypardiso.spsolve(K.tocsr(), b)
    return splu(K.tocsc()).solve(b)


def lame(young, poisson):
    return (young * poisson / ((1 + poisson) * (1 - 2 * poisson)), young / (2 * (1 + poisson)))


def cofactor(F):
    C = np.empty_like(F)
    for i in range(3):
        for j in range(3):
            a, b, c, d = (i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3
            C[i, j] = F[a, c] * F[b, d] - F[a, d] * F[b, c]
    return C


def stress(F, lam, mu):
    """P = mu F + ((lam + mu) (J - 1) - mu) cof F; F[3][3][...]. Returns (P, cof F, its factor)."""
    C = cofactor(F)
    J = sum(F[0, j] * C[0, j] for j in range(3))
    c = (lam + mu) * (J - 1) - mu
    return mu * F + c * C, C, c


def stress_change(F, C, c, D, lam, mu):
    """The change of P when F changes by D."""
    DC = np.empty_like(F)
    for i in range(3):
        for j in range(3):
            a, b, g, d = (i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3
            DC[i, j] = D[a, g] * F[b, d] + F[a, g] * D[b, d] - D[a, d] * F[b, g] - F[a, d] * D[b, g]
    return mu * D + (lam + mu) * np.einsum('ij...,ij...->...', C, D) * C + c * DC


class Solid:
    """Finite elements of one kind on a mesh: forces and stiffness with all that is kinematic in
    `gradient(w, grad, value)`, which gives F - I from a displacement and its gradient."""

    def __init__(self, basis, gradient, weight, lam, mu, body_force=None):
        self.basis, self.lam, self.mu = basis, lam, mu
        x = basis.global_coordinates().value
        dx = basis.dx * weight(x)
        self.n = basis.N
        fields = [basis.basis[k][0] for k in range(basis.Nbfun)]
        self.G = np.array([gradient(x, f.grad, f.value) for f in fields])  # [k][3][3][e][q]
        self.dx = dx
        self.dofs = basis.element_dofs  # [k][e]
        self.load = np.zeros(self.n)
        if body_force is not None:
            for k, f in enumerate(fields):
                np.add.at(self.load, self.dofs[k],
                          np.einsum('i,ieq,eq->e', body_force, f.value, dx))

    def strain(self, u):
        return np.einsum('kijeq,ke->ijeq', self.G, u[self.dofs])

    def forces(self, u):
        F = self.strain(u) + np.eye(3)[:, :, None, None]
        P, _, _ = stress(F, self.lam, self.mu)
        f = np.zeros(self.n)
        np.add.at(f, self.dofs, np.einsum('kijeq,ijeq,eq->ke', self.G, P, self.dx))
        return f - self.load

    def stiffness(self, u, exact=True):
        F = self.strain(u) + np.eye(3)[:, :, None, None]
        _, C, c = stress(F, self.lam, self.mu)
        K = len(self.G)
        rows, cols, values = [], [], []
        flat = (self.G * self.dx).reshape(K, 9, *self.dx.shape)
        for k in range(K):
            D = stress_change(F, C, c, self.G[k], self.lam, self.mu).reshape(9, *self.dx.shape)
            of_k = np.einsum('lneq,neq->le', flat, D)
            rows.append(self.dofs)
            cols.append(np.broadcast_to(self.dofs[k], self.dofs.shape))
            values.append(of_k)
        shape = (self.n, self.n)
        return coo_matrix((np.concatenate(values, axis=None),
                           (np.concatenate(rows, axis=None), np.concatenate(cols, axis=None))), shape).tocsc()

    def mass(self, density):
        K = len(self.G)
        fields = [self.basis.basis[k][0].value for k in range(K)]
        rows, cols, values = [], [], []
        for k in range(K):
            for l in range(K):
                rows.append(self.dofs[l])
                cols.append(self.dofs[k])
                values.append(density * np.einsum('ieq,ieq,eq->e', fields[k], fields[l], self.dx))
        shape = (self.n, self.n)
        return coo_matrix((np.concatenate(values, axis=None),
                           (np.concatenate(rows, axis=None), np.concatenate(cols, axis=None))), shape).tocsc()


def newton(forces, stiffness, u, free, scale, most=60):
    """Solves forces(u)[free] = 0 from u on. Steps are halved where the residual would grow; where that does not
    help, stiffness(u, False) is used, which may leave out what makes it indefinite."""
    r = forces(u)[free]
    for _ in range(most):
        size = np.linalg.norm(r)
        if np.abs(r).max() < 1e-8 * scale:
            return u
        for exact in (True, False):
            step = solve(stiffness(u, exact)[free][:, free], -r)
            length, fits = 1.0, False
            while length > 1e-2 and not fits:
                trial = u.copy()
                trial[free] += length * step
                new = forces(trial)[free]
                fits = np.isfinite(new).all() and np.linalg.norm(new) < size
                length /= 2
            if fits:
                break
        if not fits and np.abs(r).max() < 1e-6 * scale:
            return u  # as near as rounding lets it
        u, r = trial, new
    raise RuntimeError('Newton did not converge: %g of %g' % (np.abs(r).max(), scale))
