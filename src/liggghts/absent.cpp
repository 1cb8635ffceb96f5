// What a build without LIGGGHTS says.
#include "liggghts/liggghts_terrain.h"
#include "liggghts/ranks.h"

namespace terrode::liggghts {

bool available() { return false; }

std::optional<int> serve() { return std::nullopt; }

std::unique_ptr<terrain::Terrain> make_terrain(LiggghtsParams params) {
  throw_if_any(params.validate());
  throw InputError({{}, 0, 0, "method", "is 'mpi', but this terrode was built without LIGGGHTS",
                    "a build with the packages libliggghts-dev and libopenmpi-dev (docs/cluster.md)"});
}

}  // namespace terrode::liggghts
