"""Points to surfaces: a density on a grid, and the mesh where it falls to half."""
import numpy as np


class Mesh:
    """Triangles with a normal and a colour at each vertex.

    vertices, normals, colors: (n, 3); triangles: (m, 3); `metal` from 0, plastic, to 1, steel, or
    None for tissue.
    """

    def __init__(self, vertices, triangles, normals, colors, metal=None):
        self.vertices = np.asarray(vertices, np.float32)
        self.triangles = np.asarray(triangles, np.int64)
        self.normals = np.asarray(normals, np.float32)
        self.colors = np.asarray(colors, np.float32)
        self.metal = metal


class Grid:
    """A scalar or vector field on a regular grid."""

    def __init__(self, origin, spacing, values):
        self.origin, self.spacing, self.values = origin, spacing, values

    def sample(self, x):
        """Trilinear values at points x (n, 3); clamped at the border."""
        shape = np.array(self.values.shape[:3])
        q = np.clip((x - self.origin) / self.spacing, 0, shape - 1.001).astype(np.float32)
        i = q.astype(np.int32)
        f = q - i
        flat = self.values.reshape(-1, *self.values.shape[3:])
        base = (i[:, 0] * shape[1] + i[:, 1]) * shape[2] + i[:, 2]
        result = 0
        for dx in (0, 1):
            wx = f[:, 0] if dx else 1 - f[:, 0]
            for dy in (0, 1):
                wy = wx * (f[:, 1] if dy else 1 - f[:, 1])
                for dz in (0, 1):
                    w = wy * (f[:, 2] if dz else 1 - f[:, 2])
                    v = flat[base + (dx * shape[1] + dy) * shape[2] + dz]
                    result = result + (w[:, None] * v if v.ndim > 1 else w * v)
        return result


def point_spacing(points):
    """Distance between neighbouring points [m], also of a thinned cloud."""
    rng = np.random.default_rng(0)
    sample = points[rng.choice(len(points), min(300, len(points)), replace=False)]
    rank = min(6, len(points) - 1)
    sixth = [np.partition(np.sum((points - s) ** 2, axis=1), rank)[rank] for s in sample]
    return float(np.sqrt(np.percentile(sixth, 30)))


def blur(values, sigma):
    """Gaussian of `sigma` cells along each axis."""
    reach = int(np.ceil(3 * sigma))
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    weights = (weights / weights.sum()).astype(np.float32)
    for axis in range(3):
        pad = [(reach, reach) if a == axis else (0, 0) for a in range(3)]
        padded = np.pad(values, pad)
        n = values.shape[axis]
        values = sum(w * np.take(padded, range(k, k + n), axis) for k, w in enumerate(weights))
    return values


def deposit(points, weights, spacing, margin):
    """Sums of `weights` spread trilinearly over a grid that reaches `margin` around the points."""
    origin = points.min(0) - margin
    shape = np.ceil((points.max(0) + margin - origin) / spacing).astype(int) + 2
    q = (points - origin) / spacing
    i = q.astype(np.int64)
    f = q - i
    total = np.zeros(shape.prod())
    for corner in range(8):
        d = np.array([corner >> 2 & 1, corner >> 1 & 1, corner & 1])
        w = np.prod(np.where(d, f, 1 - f), axis=1) * weights
        c = i + d
        total += np.bincount((c[:, 0] * shape[1] + c[:, 1]) * shape[2] + c[:, 2], w, len(total))
    return Grid(origin, spacing, total.reshape(shape).astype(np.float32))


def half_density_surface(density):
    """Vertices and triangles where the density is 1/2 (surface nets: one vertex in each cell that
    the surface passes, one quad across each grid edge that it crosses)."""
    d = density.values
    cells = [slice(None, -1), slice(1, None)]
    corner = [d[cells[a], cells[b], cells[c]] for a in (0, 1) for b in (0, 1) for c in (0, 1)]
    count = sum((v > 0.5).astype(np.int8) for v in corner)
    active = (count > 0) & (count < 8)
    ijk = np.argwhere(active)
    number = np.full(active.shape, -1, np.int64)
    number[active] = np.arange(len(ijk))
    value = np.stack([v[active] for v in corner], 1)
    total, crossings = np.zeros((len(ijk), 3)), np.zeros(len(ijk))
    for axis in range(3):
        bit = 4 >> axis
        for lo in range(8):
            if lo & bit:
                continue
            a, b = value[:, lo], value[:, lo | bit]
            cross = (a > 0.5) != (b > 0.5)
            p = np.stack([np.full(len(a), float(lo >> 2 & 1)), np.full(len(a), float(lo >> 1 & 1)),
                          np.full(len(a), float(lo & 1))], 1)
            p[:, axis] = (0.5 - a) / np.where(cross, b - a, 1)
            total += np.where(cross[:, None], p, 0)
            crossings += cross
    vertices = density.origin + density.spacing * (ijk + total / crossings[:, None])
    triangles = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        lo, hi = [slice(None)] * 3, [slice(None)] * 3
        lo[axis], hi[axis] = slice(None, -1), slice(1, None)
        a, b = d[tuple(lo)] > 0.5, d[tuple(hi)] > 0.5
        for sign in (True, False):
            e = np.argwhere((a != b) & (a == sign))
            e = e[(e[:, u] > 0) & (e[:, v] > 0)]
            du, dv = np.eye(3, dtype=int)[u], np.eye(3, dtype=int)[v]
            quad = [number[tuple(x.T)] for x in (e - du - dv, e - dv, e, e - du)]
            if not sign:
                quad.reverse()
            triangles += [np.stack([quad[0], quad[1], quad[2]], 1),
                          np.stack([quad[0], quad[2], quad[3]], 1)]
    return vertices, np.concatenate(triangles)


class Neighbours:
    """Means over the vertices that share an edge."""

    def __init__(self, triangles, vertex_count):
        edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
        self.a, self.b = np.concatenate([edges, edges[:, ::-1]]).T
        self.n = vertex_count
        self.count = np.maximum(np.bincount(self.a, minlength=self.n), 1)[:, None]

    def mean(self, x):
        return np.stack([np.bincount(self.a, column[self.b], self.n) for column in x.T],
                        1) / self.count


def smoothed(vertices, neighbours, rounds, share):
    """Evens out steps without shrinking (Taubin 1995); `share` (n,) in [0, 1] of each vertex."""
    for k in range(2 * rounds):
        step = (0.55 if k % 2 == 0 else -0.57) * share[:, None]
        vertices = vertices + step * (neighbours.mean(vertices) - vertices)
    return vertices


def shading_normals(vertices, triangles, neighbours, even_share):
    """Normals without the terraces that a lattice leaves on a round body; edges keep theirs, but
    for `even_share` (n, 1)."""
    corners = vertices[triangles]
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    own = np.stack([np.bincount(triangles.ravel(), np.repeat(n[:, axis], 3), len(vertices))
                    for axis in range(3)], 1)
    own /= np.linalg.norm(own, axis=1, keepdims=True) + 1e-20
    even = own
    for _ in range(40):
        even = neighbours.mean(even)
    even /= np.linalg.norm(even, axis=1, keepdims=True) + 1e-20
    alike = np.clip((np.sum(own * even, axis=1, keepdims=True) - 0.80) / 0.12, even_share, 1)
    mixed = own * (1 - 0.85 * alike) + even * 0.85 * alike
    return mixed / (np.linalg.norm(mixed, axis=1, keepdims=True) + 1e-20)


def crease_normals(corners, crease=0.6):
    """Normals at the corners (3 m, 3) of triangles (m, 3, 3): the mean of the triangles that meet
    there and whose own differ by a cosine of more than `crease`; so edges of a cut stay edges."""
    face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    unit = face / (np.linalg.norm(face, axis=1, keepdims=True) + 1e-20)
    _, place = np.unique(corners.reshape(-1, 3).astype(np.float32), axis=0, return_inverse=True)
    place = place.reshape(-1)
    around = [[] for _ in range(place.max() + 1)]
    for corner, at in enumerate(place):
        around[at].append(corner // 3)
    normals = np.empty((len(place), 3))
    for corner, at in enumerate(place):
        near = [t for t in around[at] if unit[t] @ unit[corner // 3] > crease]
        normals[corner] = face[near].sum(0)
    return normals / (np.linalg.norm(normals, axis=1, keepdims=True) + 1e-20)


def tissue_surface(points, weights, values, spacing, smoothing, cut_face):
    """The surface of one piece: (vertices, triangles, normals, values at the vertices).

    points (n, 3) [m]; weights (n,): 1, less where it is to have a furrow; values (n, k): what the points carry, to be had at the surface; `smoothing`
    of those values gives the rounds in which the surface is evened out, and
    `cut_face` (n, 1) where it is a face whose normals are to be even."""
    h = spacing / 2
    margin = 2.5 * spacing
    density = deposit(points, weights, h, margin)
    spread = 1.15
    density.values = blur(density.values, spread)
    inside = np.percentile(density.sample(points), 70)
    share = deposit(points, np.ones(len(points)), h, margin)
    share = np.maximum(blur(share.values, spread), 1e-3 * inside)
    carried = []
    for k in range(values.shape[1]):
        field = deposit(points, values[:, k], h, margin)
        field.values = blur(field.values, spread) / share
        carried.append(field)
    density.values /= inside
    vertices, triangles = half_density_surface(density)
    at_vertices = np.stack([f.sample(vertices) for f in carried], 1)
    neighbours = Neighbours(triangles, len(vertices))
    for rounds, share in smoothing(at_vertices):
        vertices = smoothed(vertices, neighbours, rounds, share)
    return vertices, triangles, shading_normals(
        vertices, triangles, neighbours, cut_face(at_vertices)), at_vertices


def occupancy(points, spacing, reach):
    """How much of the space around a place is tissue, 0 to 1, blurred over `reach` [m]."""
    h = reach / 2
    grid = deposit(points, np.full(len(points), (spacing / h) ** 3), h, 4 * reach)
    grid.values = np.minimum(blur(grid.values, 2.0), 1)
    return grid
