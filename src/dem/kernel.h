// The inner loops, chosen at run time for the widest vectors the processor has. Plain functions on plain data.
//
// Particles are kept in three arrays of four doubles each (one or two loads fetch all of a neighbour that a loop
// needs):
//   position  x y z radius        velocity  vx vy vz 1/mass (0: does not yield)     spin  wx wy wz 1/inertia
// and loads in one of eight: fx fy fz 0 tx ty tz 0.
#pragma once

#include <cstdint>

#include "dem/law/contact.h"

namespace terrode::dem {

// Contacts are stored in blocks of this many, each history number contiguous over a block.
inline constexpr int block_size = 8;

struct PairArrays {
  const double* position = nullptr;
  const double* velocity = nullptr;
  const double* spin = nullptr;
  double* load = nullptr;           // accumulated
  const std::int32_t* i = nullptr;  // of each slot; slots come in whole blocks, spare ones repeat the last pair
  const std::int32_t* j = nullptr;
  double* history = nullptr;  // history_stride doubles a block
  int history_stride = 0;
  double* exported = nullptr;          // loads on partners of other chunks, eight doubles a slot of an external run
  double period[3] = {0.0, 0.0, 0.0};  // m; 0: not periodic
  double inverse_period[3] = {0.0, 0.0, 0.0};
  double dt = 0.0;
};

// Slots [begin, begin + count) of one law; external: the partner j belongs to another chunk, and its load goes to
// exported[8 (slot - export_offset)...] instead of load[j].
struct PairRun {
  int begin = 0, count = 0, law = 0;
  std::int32_t external = 0;  // 1: see above; no padding, so that equal states have equal bytes
  int export_offset = 0;
};

// Kick and drift of particles [begin, end): velocity += (F/m + g) dt, spin += T/I dt, position += velocity dt, loads
// cleared. Particles with body >= 0 are left to their body. kick_dt is dt, or dt/2 in the first step.
struct DriftArrays {
  double* position = nullptr;
  double* velocity = nullptr;
  double* spin = nullptr;
  double* load = nullptr;
  const std::int32_t* body = nullptr;
  double gravity[3] = {0.0, 0.0, 0.0};
  // N s/m, force -viscous v on every free particle, and torque -4/3 viscous R^2 w: the ratio of Stokes' drag.
  double viscous = 0.0;
  double dt = 0.0, kick_dt = 0.0;
};

struct Kernels {
  const char* name;
  int width;
  void (*pairs)(const PairArrays&, const PairLaw&, const PairRun&);
  double (*drift)(const DriftArrays&, int begin, int end);  // returns the largest speed squared, (m/s)^2
};

// The kernels for this processor; `name` ("generic", "avx2", "avx512") asks for one, and throws InputError if this
// processor lacks it. All give the same digits.
const Kernels& kernels(const char* name = nullptr);

}  // namespace terrode::dem
