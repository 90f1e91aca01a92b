// STL files, binary and text, as programs write them in fact.
#pragma once

#include <string>

#include "geometry/mesh.h"

namespace tissue_sim {

/// The triangles of an STL file's bytes, three vertices of its own for each. Binary is what holds
/// as many triangles as it says at byte 80, whatever its header begins with and whatever follows
/// them (colours, a signature, padding); a count of zero, which writers of streams leave, is what
/// the size says. Text may be in capitals, with several solids; its normals are not read. Throws
/// std::invalid_argument with a reason that starts with a verb.
TriangleMesh read_stl(const std::string& bytes);

}  // namespace tissue_sim
