"""Vertices of a mesh file, to know how large it is: STL, OBJ, PLY; text or binary."""
import numpy as np

PLY_TYPES = {"char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2",
             "ushort": "u2", "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4",
             "uint32": "u4", "float": "f4", "float32": "f4", "double": "f8", "float64": "f8"}


def mesh_points(path):
    """(n, 3) in the file's unit. Raises ValueError naming the file."""
    with open(path, "rb") as file:
        data = file.read()
    kind = path.lower().rsplit(".", 1)[-1]
    if kind not in ("stl", "obj", "ply"):
        raise ValueError("%s: only STL, OBJ and PLY are read here" % path)
    try:
        points = {"stl": stl_points, "obj": obj_points, "ply": ply_points}[kind](data)
    except (ValueError, IndexError, KeyError, StopIteration, TypeError) as e:
        raise ValueError("%s: cannot be read as %s (%s)" % (path, kind.upper(), e))
    if not len(points) or not np.isfinite(points).all():
        raise ValueError("%s: holds no vertices, or some that are not finite" % path)
    return points.astype(float)


def stl_points(data):
    count = int.from_bytes(data[80:84], "little")
    if len(data) == 84 + 50 * count:
        facet = np.dtype([("floats", "<f4", 12), ("attribute", "<u2")])
        return np.frombuffer(data, facet, count, 84)["floats"][:, 3:].reshape(-1, 3)
    return words_after(data, b"vertex")


def obj_points(data):
    return words_after(data, b"v")


def words_after(data, key):
    lines = (line.split() for line in data.splitlines())
    return np.array([line[1:4] for line in lines if line and line[0] == key], float).reshape(-1, 3)


def ply_points(data):
    header, body = data.split(b"end_header", 1)
    body = body.split(b"\n", 1)[1]
    lines = [line.split() for line in header.decode("ascii").splitlines()]
    style = next(line[1] for line in lines if line[0] == "format")
    elements = [i for i, line in enumerate(lines) if line and line[0] == "element"]
    if lines[elements[0]][1] != "vertex":
        raise ValueError("its vertices do not come first")
    count = int(lines[elements[0]][2])
    properties = [line for line in lines[elements[0] + 1:(elements + [len(lines)])[1]]
                  if line[0] == "property"]
    names = [line[-1] for line in properties]
    if style == "ascii":
        table = np.array([line.split()[:len(names)] for line in body.splitlines()[:count]], float)
        return np.stack([table[:, names.index(axis)] for axis in "xyz"], 1)
    order = "<" if "little" in style else ">"
    table = np.frombuffer(body, np.dtype([(line[-1], order + PLY_TYPES[line[1]])
                                          for line in properties]), count)
    return np.stack([table[axis] for axis in "xyz"], 1)
