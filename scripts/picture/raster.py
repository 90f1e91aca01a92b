"""A camera and a z-buffer."""
import numpy as np


def normalized(v):
    v = np.asarray(v)
    length = np.sqrt(np.einsum("...i,...i->...", v, v))
    return v / np.maximum(length, 1e-20)[..., None]


class Camera:
    """Looks from `eye` at `target` with z up. Perspective with `field_of_view` [deg] over the
    height, or, for the shadow's light, parallel with a picture `parallel_height` [m] high."""

    def __init__(self, eye, target, size, field_of_view=24.0, parallel_height=None):
        self.eye, self.size = np.asarray(eye, float), size
        forward = normalized(np.asarray(target) - self.eye)
        right = normalized(np.cross(forward, [0, 0, 1]))
        self.axes = np.stack([right, np.cross(right, forward), forward])
        self.parallel = parallel_height is not None
        span = parallel_height if self.parallel else 2 * np.tan(np.radians(field_of_view) / 2)
        self.scale = size[1] / span

    def project(self, x):
        """World points to (column, row, depth [m])."""
        q = (x - self.eye) @ self.axes.T
        shrink = self.scale if self.parallel else self.scale / np.maximum(q[:, 2], 1e-6)
        return np.stack([self.size[0] / 2 + q[:, 0] * shrink, self.size[1] / 2 - q[:, 1] * shrink,
                         q[:, 2]], 1)

    def rays(self):
        """Direction of each pixel's ray with a depth of 1 (rows, columns, 3); perspective only."""
        w, h = self.size
        c = (np.arange(w) + 0.5 - w / 2) / self.scale
        r = (h / 2 - np.arange(h) - 0.5) / self.scale
        a = self.axes.astype(np.float32)
        return (c[None, :, None].astype(np.float32) * a[0] + r[:, None, None].astype(np.float32) *
                a[1] + a[2])


class Buffer:
    """What is nearest in each pixel: depth, and which triangle at which barycentric place."""

    def __init__(self, camera):
        self.camera = camera
        w, h = camera.size
        self.depth = np.full(h * w, np.inf, np.float32)
        self.triangle = np.full(h * w, -1, np.int32)
        self.place = np.zeros((h * w, 2), np.float32)

    def draw(self, vertices, triangles, first_triangle=0):
        """Draws a mesh; its triangles are numbered from `first_triangle` on."""
        w, h = self.camera.size
        p = self.camera.project(vertices)[triangles]
        lo = np.floor(p[:, :, :2].min(1)).astype(np.int64)
        hi = np.ceil(p[:, :, :2].max(1)).astype(np.int64)
        seen = ((p[:, :, 2].min(1) > 1e-4) & (hi[:, 0] > 0) & (hi[:, 1] > 0) & (lo[:, 0] < w) &
                (lo[:, 1] < h))
        if not seen.any():  # NumPy 1.17 knows no unique rows of none
            return
        lo, hi = np.maximum(lo, 0), np.minimum(hi, [w, h])
        extent = np.maximum(hi - lo, 1)
        window = 2 ** np.ceil(np.log2(extent)).astype(int)
        for shape in np.unique(window[seen], axis=0):
            of_shape = np.nonzero(seen & (window == shape).all(1))[0]
            chunk = max(1, 2_000_000 // int(shape.prod()))
            for start in range(0, len(of_shape), chunk):
                t = of_shape[start:start + chunk]
                self._draw_windows(p[t], t + first_triangle, lo[t], hi[t], shape)

    def _draw_windows(self, p, number, lo, hi, shape):
        w = self.camera.size[0]
        cols = lo[:, 0, None, None] + np.arange(shape[0])[None, None, :]
        rows = lo[:, 1, None, None] + np.arange(shape[1])[None, :, None]
        x, y = cols + np.float32(0.5), rows + np.float32(0.5)
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = (p[:, k].T[:, :, None, None] for k in range(3))
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        area = np.where(np.abs(area) < 1e-9, np.nan, area)  # a line: nothing is inside
        u = ((x - ax) * (cy - ay) - (y - ay) * (cx - ax)) / area
        v = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / area
        with np.errstate(invalid="ignore"):  # NumPy 1.17 warns where it compares a NaN
            inside = ((u >= 0) & (v >= 0) & (u + v <= 1) & (cols < hi[:, 0, None, None]) &
                      (rows < hi[:, 1, None, None]))
        t, r, c = np.nonzero(inside)
        u, v = u[t, r, c], v[t, r, c]
        wa, wb, wc = ((1 - u - v) / az[t, 0, 0], u / bz[t, 0, 0], v / cz[t, 0, 0])
        if self.camera.parallel:
            depth = (1 - u - v) * az[t, 0, 0] + u * bz[t, 0, 0] + v * cz[t, 0, 0]
        else:
            depth = 1 / (wa + wb + wc)
            u, v = wb * depth, wc * depth
        pixel = rows[t, r, 0] * w + cols[t, 0, c]
        nearer = np.nonzero(depth < self.depth[pixel])[0]
        order = nearer[np.argsort(-depth[nearer], kind="stable")]  # the nearest is written last
        pixel = pixel[order]
        self.depth[pixel] = depth[order]
        self.triangle[pixel] = number[t[order]]
        self.place[pixel, 0], self.place[pixel, 1] = u[order], v[order]

