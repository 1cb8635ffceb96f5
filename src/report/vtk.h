// Frames as VTK XML for ParaView: a .pvd that names the files of every moment.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "core/progress.h"
#include "recording/frames.h"

namespace terrode::report {

// Writes PATH.pvd and, in the folder PATH_frames beside it, for each frame what there is of
//   ground_NNNN.vts     structured surface with `sinkage` [m], `height` [m] and `pressure` [Pa] at the nodes
//   bodies_NNNN.vtp     the shapes of all bodies where they stand, with `body` (their index) on every face
//   forces_NNNN.vtp     one point a body at its origin with `force` [N] and `moment` [N m]
//   particles_NNNN.vtp  centres with `radius` [m], `id` and, where kept, `velocity` [m/s]
// (VTK File Formats for VTK 4.2 and later, Kitware; inline base64). `path` may end in .pvd. Throws RunError when a file
// cannot be written, Interrupted when asked to stop. Returns the files written, the .pvd last.
std::vector<std::filesystem::path> write_vtk(const recording::FrameReader& frames, const std::filesystem::path& path,
                                             const Progress& progress = {});

}  // namespace terrode::report
