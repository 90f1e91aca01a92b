"""A picture of one moment: tissue, instruments, ground."""
import itertools

import numpy as np

from picture.instruments import placed, tool_meshes
from picture.light import (FLOOR, KEY, KEY_COLOR, SKY, Noise, Shadow, dot, shade_metal,
                           shade_tissue, smoothstep, tone)
from picture.raster import Buffer, Camera, normalized
from picture.surface import Mesh, crease_normals, occupancy, point_spacing, tissue_surface

LIVER = np.array([0.155, 0.016, 0.013])
FRESH_CUT = np.array([0.34, 0.028, 0.022])
LOOSE = np.array([[0.30, 0.085, 0.016], [0.20, 0.035, 0.13], [0.26, 0.17, 0.03], [0.09, 0.07, 0.22]])
DRAPE = np.array([0.030, 0.085, 0.100], np.float32)
SURROUND = np.array([0.012, 0.030, 0.037], np.float32)


def linear(srgb):
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def stress_colors(share):
    """sRGB of a stress, as a share of the scale's end: from liver to white heat."""
    stops = np.array([[0.30, 0.07, 0.10], [0.62, 0.10, 0.12], [0.93, 0.38, 0.10],
                      [1.00, 0.76, 0.22], [1.00, 0.98, 0.80]])
    at = np.linspace(0, 1, len(stops))
    return np.stack([np.interp(share, at, stops[:, k]) for k in range(3)], -1)


class Moment:
    """What there is to be seen at one time.

    points: array with the fields of tissue_sim::Point; tools: [(entry of the scene's tools,
    position (3,), rotation (3, 3))]; surface: corners of triangles between points (m, 3, 3), where
    the method has some."""

    def __init__(self, points, tools, ground_z=0.0, surface=None):
        self.points, self.tools, self.ground_z, self.surface = points, tools, ground_z, surface
        self.x = np.stack([points["x"], points["y"], points["z"]], 1).astype(float)


def camera_for(boxes, size, azimuth=-80.0, elevation=31.0, room=1.0):
    """A camera that sees all the boxes [(min, max)] from azimuth and elevation [deg]."""
    lo = np.min([b[0] for b in boxes], 0)
    hi = np.max([b[1] for b in boxes], 0)
    corners = np.array([[(lo, hi)[i][0], (lo, hi)[j][1], (lo, hi)[k][2]]
                        for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    a, e = np.radians([azimuth, elevation])
    away = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    target = (lo + hi) / 2
    distance = 10 * np.linalg.norm(hi - lo)
    for _ in range(8):
        p = Camera(target + away * distance, target, size).project(corners)
        spread = np.abs(p[:, :2] / np.asarray(size) - 0.5).max()
        distance *= spread / (0.45 / room)
    return Camera(target + away * distance, target, size)


def piece_hues(fragments):
    """The pieces of at least eight points, and the colour of each: the largest is liver."""
    ids, counts = np.unique(fragments, return_counts=True)
    ids, counts = ids[counts >= 8], counts[counts >= 8]
    hues = itertools.cycle(LOOSE)
    return {i: LIVER if i == ids[np.argmax(counts)] else next(hues) for i in ids}


def colored(base, stress, cut, closed, stress_ends):
    """Colours at vertices, as tissue or by stress, one array for each of stress_ends."""
    tissue = base * (1 - cut) + (0.5 * base + 0.7 * FRESH_CUT) * cut
    tissue *= 1 - 0.85 * closed
    return tissue, [(linear(stress_colors(stress / end)) * (1 - 0.8 * closed) if end
                     else tissue).astype(np.float32) for end in stress_ends]


def tissue_meshes(moment, spacing, around, stress_ends):
    """One mesh for each piece, and for each of them its colours, one for each of stress_ends."""
    p = moment.points
    hue_of = piece_hues(p["fragment"])
    whole = len(hue_of) == 1  # a cut under way is a furrow, a finished one two smooth faces
    meshes, colors = [], []
    for fragment, base in hue_of.items():
        own = p["fragment"] == fragment
        carried = np.stack([p["stress"][own], p["damage"][own]], 1).astype(float)
        weights = 1 - (1.5 if whole else 0.8) * np.minimum(p["damage"][own], 0.6)
        vertices, triangles, normals, values = tissue_surface(
            moment.x[own], weights, carried, spacing,
            lambda v: [(2 if whole else 60, smoothstep(0.03, 0.12, v[:, 1])), (12, np.ones(len(v)))],
            lambda v: smoothstep(0.15, 0.25, v[:, 1:2]) * (not whole))
        cut = smoothstep(0.10, 0.26, values[:, 1:2])
        closed = smoothstep(0.5, 0.75, around.sample(vertices + 0.003 * normals))[:, None] * cut
        tissue, own_colors = colored(base, values[:, 0], cut, closed, stress_ends)
        colors.append(own_colors)
        meshes.append(Mesh(vertices, triangles, normals, tissue))
    return meshes, colors


def surface_meshes(moment, stress_ends):
    """The same of a surface that the method has: its own triangles, with the values of its points."""
    corners = moment.surface.reshape(-1, 3)
    places, place_of = np.unique(corners.astype(np.float32), axis=0, return_inverse=True)
    nearest = np.array([np.argmin(np.sum((moment.x - x) ** 2, axis=1)) for x in places])
    point = moment.points[nearest[place_of.reshape(-1)]]
    normals = crease_normals(moment.surface)
    meshes, colors = [], []
    for fragment, base in piece_hues(moment.points["fragment"]).items():
        # Both halves of a fresh cut stand at the same places: most corners tell.
        own = np.repeat((point["fragment"] == fragment).reshape(-1, 3).sum(1) > 1, 3)
        cut = smoothstep(0.10, 0.26, point["damage"][own].astype(float))[:, None]
        tissue, own_colors = colored(base, point["stress"][own].astype(float), cut, 0, stress_ends)
        colors.append(own_colors)
        meshes.append(Mesh(corners[own], np.arange(own.sum()).reshape(-1, 3), normals[own], tissue))
    return meshes, colors


def ground_light(x, shadow, around, camera):
    """Drape with a grid of 10 mm that fades into the surround."""
    color = np.broadcast_to(DRAPE, x.shape).copy()
    pixel = np.linalg.norm(x - camera.eye, axis=1) / camera.scale
    for axis in (0, 1):
        off = np.abs((x[:, axis] / 0.01 + 0.5) % 1 - 0.5) * 0.01
        slant = pixel * (1 if axis == 0 else 2)
        line = np.clip(1 - (off - 0.00012) / slant, 0, 1) * np.minimum(1, 0.0003 / slant)
        color = color * (1 + 0.32 * line[:, None])
    sky = np.clip(1 - 1.35 * around.sample(x + [0, 0, 0.002]), 0.05, 1)[:, None]
    lit = shadow.lit(x, 0.0035, 24)[:, None]
    light = KEY_COLOR * KEY[2] / np.pi * lit * 1.15 + SKY * sky * 0.8
    bleed = np.clip(around.sample(x + [0, 0, 0.004]), 0, 1)[:, None] * [0.030, 0.004, 0.003]
    return color * light + bleed * (0.2 + lit)


def ground_picture(moment, camera, shadow, around, center, radius):
    """Ground and surround alone, as (rows * columns, 3) in [0, 1]."""
    rays = camera.rays().reshape(-1, 3)
    image = np.tile(SURROUND, (len(rays), 1))
    below = np.nonzero(rays[:, 2] < -1e-4)[0]
    x = camera.eye + rays[below] * ((moment.ground_z - camera.eye[2]) / rays[below, 2])[:, None]
    far = np.hypot(x[:, 0] - center[0], x[:, 1] - center[1])
    fade = smoothstep(2.4 * radius, 1.0 * radius, far)[:, None].astype(np.float32)
    near = fade[:, 0] > 0
    light = ground_light(x[near].astype(np.float32), shadow, around, camera)
    image[below[near]] = light * fade[near] + SURROUND * (1 - fade[near])
    return tone(image)


def draw(moment, camera, stress_ends=(None,), supersample=2):
    """Pictures (rows, columns, 3) in [0, 1], one for each of stress_ends: coloured by stress up to
    there [Pa], or as tissue for None."""
    big = Camera.__new__(Camera)
    big.__dict__.update(camera.__dict__, size=tuple(supersample * s for s in camera.size),
                        scale=camera.scale * supersample)
    spacing = point_spacing(moment.x)
    around = occupancy(moment.x, spacing, 0.0045)
    if moment.surface is None:
        meshes, colors = tissue_meshes(moment, spacing, around, stress_ends)
    else:
        meshes, colors = surface_meshes(moment, stress_ends)
    for tool, position, rotation in moment.tools:
        meshes += [placed(m, position, rotation) for m in tool_meshes(tool)]
    lo, hi = moment.x.min(0), moment.x.max(0)
    center, radius = (lo + hi) / 2, 0.75 * np.linalg.norm(hi - lo) + 0.02
    shadow = Shadow(meshes, center, radius)
    buffer, first = Buffer(big), 0
    for mesh in meshes:
        buffer.draw(mesh.vertices, mesh.triangles, first)
        first += len(mesh.triangles)

    w, h = camera.size
    ground = ground_picture(moment, camera, shadow, around, center, radius).reshape(h, 1, w, 1, 3)
    empty = (buffer.triangle < 0).reshape(h, supersample, w, supersample, 1)
    images = [np.zeros((len(buffer.depth), 3), np.float32) for _ in stress_ends]
    rays, noise, first = big.rays().reshape(-1, 3), Noise(), 0
    for k, mesh in enumerate(meshes):
        pixels = np.nonzero((buffer.triangle >= first) &
                            (buffer.triangle < first + len(mesh.triangles)))[0]
        surface = Surface(mesh, buffer, pixels, first, big, rays)
        first += len(mesh.triangles)
        if k >= len(colors):
            light = shade_metal(surface.normal, surface.view, surface.at(mesh.colors), mesh.metal,
                                shadow.lit(surface.x + surface.normal * 0.0006, 0.0012))
            for image in images:
                image[pixels] = light
            continue
        lit = shadow.lit(surface.x + surface.normal * 0.0006, 0.0012)
        sky = np.clip(1.25 - 1.5 * around.sample(surface.x + surface.normal * 0.0045), 0.1, 1)
        film = noise(surface.x, 0.0038) * 0.028 + noise(surface.x, 0.0013) * 0.017
        blotch = noise(surface.x, 0.0055)[:, :1] * 0.10 + noise(surface.x, 0.0019)[:, 1:2] * 0.07
        for image, color, stress_end in zip(images, colors[k], stress_ends):
            image[pixels] = shade_tissue(
                surface.normal, surface.view, surface.at(color), 0.45 if stress_end else 0.8, lit,
                sky, film, blotch * (0.3 if stress_end else 1))
    blocks = (h, supersample, w, supersample, 3)
    return [np.where(empty, ground, tone(image).reshape(blocks)).mean((1, 3)) for image in images]


class Surface:
    """What some pixels show of a mesh: place, normal towards the eye, direction to the eye."""

    def __init__(self, mesh, buffer, pixels, first, camera, rays):
        self.corners = mesh.triangles[buffer.triangle[pixels] - first]
        self.place = buffer.place[pixels]
        self.x = (camera.eye + rays[pixels] * buffer.depth[pixels, None]).astype(np.float32)
        self.view = normalized(camera.eye - self.x).astype(np.float32)
        self.normal = normalized(self.at(mesh.normals)).astype(np.float32)
        facing = dot(self.normal, self.view)
        if mesh.metal is not None:  # a plate has two sides
            self.normal *= np.where(facing < 0, -1, 1)[:, None]
        else:  # an interpolated normal may look away from the eye at the rim
            bend = np.maximum(0.02 - facing, 0)[:, None]
            self.normal = normalized(self.normal + bend * self.view)

    def at(self, attribute):
        """A vertex attribute at the pixels."""
        corners, (u, v) = attribute[self.corners], self.place.T[:, :, None]
        return corners[:, 0] * (1 - u - v) + corners[:, 1] * u + corners[:, 2] * v
