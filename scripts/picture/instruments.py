"""Shapes of the instruments, in the tool's frame: tip at the origin, z out of the tip."""
import numpy as np

from picture.surface import Mesh

STEEL, BLUE, GRIP = (0.80, 0.82, 0.85), (0.10, 0.22, 0.36), (0.13, 0.14, 0.16)


def flat_mesh(vertices, triangles, color, metal):
    """A mesh with one normal to each triangle."""
    corners = np.asarray(vertices, float)[np.asarray(triangles)]
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    n /= np.linalg.norm(n, axis=1, keepdims=True) + 1e-20
    return Mesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3),
                np.repeat(n, 3, 0), np.tile(color, (3 * len(corners), 1)), metal=metal)


def plate(outline, half_thickness, color, metal):
    """A plate in the x-z plane. outline (n, 2) of x and z; half_thickness (n,) at each corner."""
    outline, y = np.asarray(outline, float), np.asarray(half_thickness, float)
    n = len(outline)
    center = outline.mean(0)
    rim = np.insert(outline, 1, 0, axis=1)
    vertices = np.concatenate([rim + np.outer(y, [0, 1, 0]), rim - np.outer(y, [0, 1, 0]),
                               [[center[0], y.max(), center[1]], [center[0], -y.max(), center[1]]]])
    triangles = []
    for i in range(n):
        j = (i + 1) % n
        triangles += [[2 * n, i, j], [2 * n + 1, n + j, n + i], [i, n + i, n + j], [i, n + j, j]]
    return flat_mesh(vertices, triangles, color, metal)


def lathe(profile, color, metal, around=40, squash=1.0):
    """A body of revolution about z. profile (n, 2) of radius and z; y is scaled by `squash`."""
    profile = np.asarray(profile, float)
    angle = np.linspace(0, 2 * np.pi, around + 1)
    ring = np.stack([np.cos(angle), squash * np.sin(angle)], 1)
    vertices = np.concatenate([np.column_stack([r * ring, np.full(len(ring), z)])
                               for r, z in profile])
    slope = np.gradient(profile, axis=0)
    length = np.hypot(slope[:, 0], slope[:, 1]) + 1e-12
    outward = np.stack([slope[:, 1], -slope[:, 0]], 1) / length[:, None]
    if outward[len(profile) // 2, 0] < 0:
        outward = -outward
    turn = np.stack([np.cos(angle), np.sin(angle) / squash], 1)
    normals = np.concatenate([np.column_stack([r * turn, np.full(len(ring), z)])
                              for r, z in outward])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True) + 1e-12
    m, triangles = around + 1, []
    for i in range(len(profile) - 1):
        a = i * m + np.arange(around)
        triangles += [np.stack([a, a + 1, a + m], 1), np.stack([a + 1, a + m + 1, a + m], 1)]
    return Mesh(vertices, np.concatenate(triangles), normals, np.tile(color, (len(vertices), 1)),
                metal=metal)


def scalpel(blade_length, blade_width, blade_thickness):
    """Blade with the edge along x = 0, and a handle above it."""
    heel, w, y = -blade_length, blade_width, max(blade_thickness, 0.0005) / 2
    bevel = min(0.25 * w, 0.0014)
    back = -1.7 * w  # from here to the tip the spine runs down to the edge
    outline = [(0, 0), (0, back), (0, heel), (-bevel, heel), (-bevel, back), (-bevel, -1.3 * bevel)]
    edge = plate(outline, [0, 0, 0, y, y, y], (0.93, 0.94, 0.96), 1.0)
    body = plate([(-bevel, -1.3 * bevel), (-bevel, back), (-bevel, heel), (-w, heel), (-w, back)],
                 [y] * 5, STEEL, 1.0)
    neck = plate([(-0.1 * w, heel), (-0.25 * w, heel - 0.012), (-0.8 * w, heel - 0.012),
                  (-0.95 * w, heel)], [2 * y, 0.0014, 0.0014, 2 * y], STEEL, 1.0)
    z = heel - 0.012
    handle = lathe([(0.0016, z), (0.0030, z - 0.003), (0.0042, z - 0.012), (0.0046, z - 0.035),
                    (0.0040, z - 0.075), (0.0040, z - 0.12)], STEEL, 0.85, squash=0.45)
    handle.vertices[:, 0] -= 0.5 * w
    return [edge, body, neck, handle]


def probe(radius, length):
    """A capsule and a grip above it."""
    a = np.linspace(0, np.pi / 2, 14)
    dome = np.stack([radius * np.sin(a), radius * np.cos(a) - radius], 1)
    along = np.linspace(-radius, -length, 24)[1:]
    shaft = np.concatenate([dome, np.stack([np.full(len(along), radius), along], 1)])
    grip = [(radius, -length), (1.7 * radius, -length - 0.004), (1.9 * radius, -length - 0.02),
            (1.9 * radius, -length - 0.08)]
    return [lathe(shaft, BLUE, 0.35), lathe(grip, GRIP, 0.2)]


def grasper(length, width, angle):
    """Two jaws with flat faces, open by `angle` about a hinge at z = -length, and a shaft."""
    w, z = 0.5 * width, 0.15 * length
    meshes = []
    for side in (-1, 1):
        jaw = plate([(0, -0.1 * z), (0, -length), (side * w, -length), (side * w, -z),
                     (0.35 * side * w, 0)], [0.7 * w, w, w, w, 0.7 * w], STEEL, 1.0)
        sine, cosine = np.sin(0.5 * side * angle), np.cos(0.5 * side * angle)
        swing = np.array([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]])
        hinge = np.array([0, 0, -length])
        meshes.append(placed(jaw, hinge - swing @ hinge, swing))
    shaft = [(1.15 * w, 0.08 * length - length), (1.3 * w, -length), (1.3 * w, -1.2 * length),
             (1.3 * w, -0.1), (1.3 * w, -0.2)]
    return meshes + [lathe(shaft, GRIP, 0.2)]


def tool_meshes(tool):
    """The meshes of one entry of the scene's `tools`, in the tool's frame; `jaw` is its angle."""
    if tool.get("type") == "grasper":
        return grasper(tool.get("jaw_length", 0.015), tool.get("jaw_width", 0.004),
                       tool.get("jaw", 0.0))
    if tool.get("type") == "scalpel":
        return scalpel(tool.get("blade_length", 0.025), tool.get("blade_width", 0.006),
                       tool.get("blade_thickness", 0.0004))
    return probe(tool.get("radius", 0.003), tool.get("length", 0.10))


def placed(mesh, position, rotation):
    """The mesh at a pose; rotation (3, 3)."""
    return Mesh(mesh.vertices @ rotation.T + position, mesh.triangles, mesh.normals @ rotation.T,
                mesh.colors, mesh.metal)
