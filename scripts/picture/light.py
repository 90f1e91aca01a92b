"""How surfaces look: lights, a studio that they mirror, soft shadows, tone."""
import numpy as np

from picture.raster import Buffer, Camera, normalized

KEY, FILL, RIM = (normalized(v) for v in ([-0.35, -0.45, 1.0], [0.9, -0.5, 0.5], [0.1, 1.0, 0.45]))
KEY_COLOR = np.array([1.0, 0.96, 0.90], np.float32) * 2.6
FILL_COLOR = np.array([0.70, 0.82, 1.0], np.float32) * 0.45
RIM_COLOR = np.array([0.85, 0.92, 1.0], np.float32) * 0.9
SKY, FLOOR = np.array([0.62, 0.68, 0.75], np.float32), np.array([0.20, 0.22, 0.23], np.float32)


def dot(a, b):
    return np.einsum("...i,...i->...", a, np.asarray(b, np.float32))


def smoothstep(lo, hi, x):
    t = np.clip((x - lo) / (hi - lo), 0, 1)
    return t * t * (3 - 2 * t)


def studio(direction):
    """What a mirror sees in a direction: a dim room with a window behind, a soft box above and a
    bright wall to the left."""
    x, y, up = (direction[..., k] for k in range(3))
    level = np.sqrt(np.maximum(x * x + y * y, 1e-6))
    wall = smoothstep(0.35, 0.95, (-0.80 * x - 0.60 * y) / level) * smoothstep(-0.6, 0.0, up) * (
        smoothstep(0.9, 0.3, up))
    room = 0.05 + 0.22 * smoothstep(-0.3, 0.9, up) + 0.8 * wall
    x, y = x / np.maximum(up, 0.05), y / np.maximum(up, 0.05)
    window = box(x, -0.9, 0.15, 1.0) * box(y, 1.7, 0.1, 0.75)
    above = box(x, -0.55, 0.85, 0.2) * box(y, -0.55, 0.55, 0.15)
    return room + (2.6 * above + 0.95 * window) * smoothstep(0.05, 0.3, up)


def box(x, middle, half, blur_width):
    """1 within `half` of the middle, 0 from there on after `blur_width`."""
    return smoothstep(half + blur_width, half, np.abs(x - middle))


class Shadow:
    """Which places the key light reaches."""

    def __init__(self, meshes, center, radius, resolution=1400):
        self.camera = Camera(center + KEY * 4 * radius, center, (resolution, resolution),
                             parallel_height=2 * radius)
        self.buffer = Buffer(self.camera)
        for mesh in meshes:
            self.buffer.draw(mesh.vertices, mesh.triangles)
        self.bias = 2.2 * 2 * radius / resolution

    def lit(self, x, softness, taps=7):
        """0 in the shadow to 1 in the light; the edge is `softness` [m] wide."""
        p = self.camera.project(x).astype(np.float32)
        n = self.camera.size[0]
        rng = np.random.default_rng(0)
        turn = rng.uniform(0, 2 * np.pi, len(x)).astype(np.float32)
        total = np.zeros(len(x), np.float32)
        for k in range(taps):
            r = softness * self.camera.scale * np.sqrt((k + 0.5) / taps)
            a = turn + k * 2.39996
            c = np.clip(p[:, 0] + r * np.cos(a), 0, n - 1).astype(np.int32)
            i = np.clip(p[:, 1] + r * np.sin(a), 0, n - 1).astype(np.int32)
            total += self.buffer.depth[i * n + c] > p[:, 2] - self.bias - 0.35 * softness
        return total / taps


def highlight(normal, view, light, roughness):
    """GGX times the cosine, for a dielectric's head-on reflection of 1."""
    h = normalized(view + light).astype(np.float32)
    nh, nl = np.maximum(dot(normal, h), 0), np.maximum(dot(normal, light), 0)
    nv = np.maximum(dot(normal, view), 0.05)
    a2 = roughness ** 4
    d = a2 / (np.pi * (nh * nh * (a2 - 1) + 1) ** 2)
    k = (roughness + 1) ** 2 / 8
    return d * nl / (4 * (nl * (1 - k) + k) * (nv * (1 - k) + k))


class Noise:
    """Smooth random vectors in space, repeating after 48 periods."""

    def __init__(self, seed=1, n=48):
        self.n = n
        self.values = np.random.default_rng(0).standard_normal((n, n, n, 3)).astype(np.float32)

    def __call__(self, x, period):
        q = x / period
        i = np.floor(q).astype(np.int64)
        f = (q - i).astype(np.float32)
        f = f * f * (3 - 2 * f)
        result = 0
        for corner in range(8):
            d = np.array([corner >> 2 & 1, corner >> 1 & 1, corner & 1])
            w = np.prod(np.where(d, f, 1 - f), axis=1)
            c = (i + d) % self.n
            result = result + w[:, None] * self.values[c[:, 0], c[:, 1], c[:, 2]]
        return result


def shade_tissue(normal, view, color, wet, lit, open_sky, film, blotch):
    """Moist tissue: soft terminator with red in it, a film of liquid that mirrors the studio.

    film (n, 3): how the film's normal departs from the surface's; blotch (n, 1): of the colour."""
    film = normalized(normal + film * wet).astype(np.float32)
    wrap = np.array([0.34, 0.14, 0.10], np.float32)
    color = color * np.clip(1 + blotch, 0.5, 1.6)
    result = np.zeros_like(color)
    for light, strength, shadow, shine in ((KEY, KEY_COLOR, lit, 1), (FILL, FILL_COLOR, open_sky, 1),
                                           (RIM, RIM_COLOR, open_sky, 0.25)):
        c = dot(normal, light)[:, None]
        diffuse = np.clip((c + wrap) / (1 + wrap), 0, 1) ** 1.2
        soft = np.clip(shadow[:, None] + wrap * 0.25 * (1 - shadow[:, None]), 0, 1)
        result += color * diffuse * soft * strength / np.pi
        gloss = (0.05 * highlight(film, view, light, 0.24) +
                 0.035 * highlight(film, view, light, 0.5))
        result += (shine * wet * gloss * shadow)[:, None] * strength
    up = 0.5 + 0.5 * normal[:, 2:3]
    result += color * (SKY * up + FLOOR * (1 - up)) * open_sky[:, None] * 0.75
    mirrored = 2 * dot(film, view)[:, None] * film - view
    fresnel = 0.04 + 0.65 * (1 - np.clip(dot(film, view), 0, 1)) ** 5
    return result + (wet * fresnel * studio(mirrored) * (0.25 + 0.75 * open_sky))[:, None]


def shade_metal(normal, view, color, metal, lit):
    """Brushed steel (metal = 1) to glossy plastic (0)."""
    mirrored = 2 * dot(normal, view)[:, None] * normal - view
    fresnel = 0.05 + 0.95 * (1 - np.clip(dot(normal, view), 0, 1)) ** 5
    share = metal + (1 - metal) * fresnel
    tint = metal * color + (1 - metal)
    up = 0.5 + 0.5 * normal[:, 2:3]
    key = np.clip(dot(normal, KEY), 0, 1) * lit
    diffuse = color * (1 - 0.75 * metal) * (SKY * up + FLOOR * (1 - up) + key[:, None] * KEY_COLOR / 2)
    below = 0.30 * smoothstep(0.15, -0.35, mirrored[:, 2])
    shine = tint * (share * (studio(mirrored) + below))[:, None]
    return diffuse + shine + (0.4 * lit * highlight(normal, view, KEY, 0.32))[:, None] * tint


def tone(x):
    """Film-like curve from light to sRGB in [0, 1] (Narkowicz's fit of ACES)."""
    x = np.maximum(x, 0) * 0.82
    y = np.clip(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14), 0, 1)
    return np.where(y < 0.0031308, 12.92 * y, 1.055 * y ** (1 / 2.4) - 0.055)
