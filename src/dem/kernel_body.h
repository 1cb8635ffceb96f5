// The kernels' source, included once by each kernel_<isa>.cpp.
#pragma once

#include "dem/kernel.h"
#include "dem/law/parts.h"

namespace terrode::dem::TERRODE_KERNEL_ISA {

// Nearest image: adding and subtracting 1.5 2^52 rounds to an integer at every vector width alike.
TERRODE_KERNEL Pack nearest_image(Pack d, double period, double inverse) {
  const Pack magic(6755399441055744.0);
  const Pack turns = (d * Pack(inverse) + magic) - magic;
  return d - turns * Pack(period);
}

TERRODE_KERNEL void add4(double* to, const double* from) {
  typedef double Four __attribute__((vector_size(32), aligned(8), may_alias));
  *reinterpret_cast<Four*>(to) += *reinterpret_cast<const Four*>(from);
}
TERRODE_KERNEL void copy4(double* to, const double* from) {
  typedef double Four __attribute__((vector_size(32), aligned(8), may_alias));
  *reinterpret_cast<Four*>(to) = *reinterpret_cast<const Four*>(from);
}
TERRODE_KERNEL void subtract4(double* to, const double* from) {
  typedef double Four __attribute__((vector_size(32), aligned(8), may_alias));
  *reinterpret_cast<Four*>(to) -= *reinterpret_cast<const Four*>(from);
}

template <int Tangential, int Rolling>
TERRODE_KERNEL void evaluate_known(const PairLaw& law, Contact<Pack>& c, Pack* h) {
  // The paper's composition with its branches resolved; other compositions branch once a pack.
  PairLaw known = law;
  known.normal = 1;
  known.tangential = Tangential;
  known.rolling = Rolling;
  known.cohesion = 0;
  evaluate(known, c, h);
}

template <class Evaluate>
TERRODE_KERNEL void run_pairs(const PairArrays& a, const PairLaw& law, const PairRun& run,
                              const Evaluate& evaluate_law) {
  constexpr int W = Pack::width;
  constexpr int ahead = 16;
  const int n_history = history_size(law);
  const bool periodic[3] = {a.period[0] > 0.0, a.period[1] > 0.0, a.period[2] > 0.0};
  alignas(64) double out_f[W * 4], out_ti[W * 4], out_tj[W * 4];
  const int end = run.begin + run.count;
  for (int s = run.begin; s < end; s += W) {
    const std::int32_t* pi = a.i + s;
    const std::int32_t* pj = a.j + s;
    // Partners lie anywhere in the neighbourhood: fetched ahead.
    if (s + ahead < end)
      for (int k = 0; k < W; ++k) {
        const long q = a.j[s + ahead + k];
        __builtin_prefetch(a.position + 4 * q);
        __builtin_prefetch(a.velocity + 4 * q);
        __builtin_prefetch(a.spin + 4 * q);
        if (!run.external) __builtin_prefetch(a.load + 8 * q, 1);
      }
    Pack xi[4], xj[4];
    load_records(a.position, pi, xi);
    load_records(a.position, pj, xj);
    Contact<Pack> c;
    Pack dx = xi[0] - xj[0], dy = xi[1] - xj[1], dz = xi[2] - xj[2];
    if (periodic[0]) dx = nearest_image(dx, a.period[0], a.inverse_period[0]);
    if (periodic[1]) dy = nearest_image(dy, a.period[1], a.inverse_period[1]);
    if (periodic[2]) dz = nearest_image(dz, a.period[2], a.inverse_period[2]);
    const Pack r2 = dx * dx + dy * dy + dz * dz;
    const Pack reach = xi[3] + xj[3];
    const Mask touch = (r2 < reach * reach) & first_lanes(end - s);
    const unsigned on = bits(touch);
    // A block's numbers lie number by number: lane l of number k at 8 k + l.
    double* block = a.history + static_cast<long>(s / block_size) * a.history_stride + s % block_size;
    if (on == 0) {
      for (int k = 0; k < n_history; ++k) Pack(0.0).store(block + k * block_size);
      if (run.external)
        for (int k = 0; k < 8 * W; ++k) a.exported[8 * static_cast<long>(s - run.export_offset) + k] = 0.0;
      continue;
    }
    Pack vi[4], vj[4], wi[4], wj[4];
    load_records(a.velocity, pi, vi);
    load_records(a.velocity, pj, vj);
    load_records(a.spin, pi, wi);
    load_records(a.spin, pj, wj);

    const Pack one(1.0);
    const Pack square = select(touch, r2, one);
    const Pack distance = square_root(square);
    // One division, which does not wait for the root, gives the three reciprocals that a pair needs.
    const Pack yielding = select(touch, vi[3] + vj[3], one);
    const Pack all_inverse = one / (square * (reach * yielding));
    const Pack inverse = all_inverse * (reach * yielding) * distance;
    c.nx = dx * inverse;
    c.ny = dy * inverse;
    c.nz = dz * inverse;
    c.overlap = select(touch, reach - distance, Pack(0.0));
    c.radius_eff = xi[3] * xj[3] * (all_inverse * (square * yielding));
    c.mass_eff = all_inverse * (square * reach);
    const Pack half(0.5);
    const Pack arm_i = xi[3] - half * c.overlap, arm_j = xj[3] - half * c.overlap;
    const Pack ux = vi[0] - vj[0], uy = vi[1] - vj[1], uz = vi[2] - vj[2];
    c.vn = ux * c.nx + uy * c.ny + uz * c.nz;
    const Pack sx = arm_i * wi[0] + arm_j * wj[0], sy = arm_i * wi[1] + arm_j * wj[1],
               sz = arm_i * wi[2] + arm_j * wj[2];
    c.vtx = ux - c.vn * c.nx - (sy * c.nz - sz * c.ny);
    c.vty = uy - c.vn * c.ny - (sz * c.nx - sx * c.nz);
    c.vtz = uz - c.vn * c.nz - (sx * c.ny - sy * c.nx);
    const Pack wx = wi[0] - wj[0], wy = wi[1] - wj[1], wz = wi[2] - wj[2];
    const Pack wn = wx * c.nx + wy * c.ny + wz * c.nz;
    c.wx = wx - wn * c.nx;
    c.wy = wy - wn * c.ny;
    c.wz = wz - wn * c.nz;
    // 1/I = 5/7 (1/(m_i R_i^2) + 1/(m_j R_j^2))
    const Pack ri2 = xi[3] * xi[3], rj2 = xj[3] * xj[3];
    c.inertia_eff = Pack(1.4) * ri2 * rj2 / select(touch, vi[3] * rj2 + vj[3] * ri2, one);
    c.dt = Pack(a.dt);

    Pack h[max_history];
    for (int k = 0; k < n_history; ++k) h[k] = Pack::load(block + k * block_size);
    evaluate_law(law, c, h);
    for (int k = 0; k < n_history; ++k) select(touch, h[k], Pack(0.0)).store(block + k * block_size);

    // Lanes that do not touch have zero overlap, hence stiffness, limits and forces of zero: they add nothing, at no
    // branch that would be guessed wrong.
    const Pack fx = c.fn * c.nx + c.ftx, fy = c.fn * c.ny + c.fty, fz = c.fn * c.nz + c.ftz;
    const Pack qx = c.ny * c.ftz - c.nz * c.fty, qy = c.nz * c.ftx - c.nx * c.ftz, qz = c.nx * c.fty - c.ny * c.ftx;
    const Pack zero(0.0);
    store_records(fx, fy, fz, zero, out_f, 4);
    store_records(c.mx - arm_i * qx, c.my - arm_i * qy, c.mz - arm_i * qz, zero, out_ti, 4);
    store_records(zero - c.mx - arm_j * qx, zero - c.my - arm_j * qy, zero - c.mz - arm_j * qz, zero, out_tj, 4);
    if (run.external) {
      double* exported = a.exported + 8 * static_cast<long>(s - run.export_offset);
      for (int k = 0; k < W; ++k) {
        double* e = exported + 8 * k;
        double* to = a.load + 8 * static_cast<long>(pi[k]);
        add4(to, out_f + 4 * k);
        add4(to + 4, out_ti + 4 * k);
        copy4(e, out_f + 4 * k);
        copy4(e + 4, out_tj + 4 * k);
      }
    } else {
      for (int k = 0; k < W; ++k) {
        double* to = a.load + 8 * static_cast<long>(pi[k]);
        add4(to, out_f + 4 * k);
        add4(to + 4, out_ti + 4 * k);
        double* from = a.load + 8 * static_cast<long>(pj[k]);
        subtract4(from, out_f + 4 * k);
        add4(from + 4, out_tj + 4 * k);
      }
    }
  }
}

static void pairs(const PairArrays& a, const PairLaw& law_in, const PairRun& run) {
  const PairLaw law = law_in;
  const bool plain = law.normal == 1 && law.tangential == 1 && law.cohesion == 0;
  if (plain && law.rolling == 2)
    run_pairs(
        a, law, run, [](const PairLaw& l, Contact<Pack>& c, Pack* h) __attribute__((always_inline)) {
          evaluate_known<1, 2>(l, c, h);
        });
  else if (plain && law.rolling == 3)
    run_pairs(
        a, law, run, [](const PairLaw& l, Contact<Pack>& c, Pack* h) __attribute__((always_inline)) {
          evaluate_known<1, 3>(l, c, h);
        });
  else
    run_pairs(
        a, law, run,
        [](const PairLaw& l, Contact<Pack>& c, Pack* h) __attribute__((always_inline)) { evaluate(l, c, h); });
}

static double drift(const DriftArrays& a, int begin, int end) {
  typedef double Four __attribute__((vector_size(32), aligned(8), may_alias));
  const Four g = {a.gravity[0], a.gravity[1], a.gravity[2], 0.0};
  const Four space = {1.0, 1.0, 1.0, 0.0};
  const double viscous_spin = 4.0 / 3.0 * a.viscous;
  double fastest = 0.0;
  for (int p = begin; p < end; ++p) {
    Four& x = *reinterpret_cast<Four*>(a.position + 4 * static_cast<long>(p));
    Four& v = *reinterpret_cast<Four*>(a.velocity + 4 * static_cast<long>(p));
    Four& w = *reinterpret_cast<Four*>(a.spin + 4 * static_cast<long>(p));
    Four& f = *reinterpret_cast<Four*>(a.load + 8 * static_cast<long>(p));
    Four& t = *reinterpret_cast<Four*>(a.load + 8 * static_cast<long>(p) + 4);
    if (a.body[p] >= 0) continue;
    if (a.body[p] != -1) {  // frozen
      f = Four{0.0, 0.0, 0.0, 0.0};
      t = Four{0.0, 0.0, 0.0, 0.0};
      continue;
    }
    const Four viscous = space * a.viscous * v;
    v += (((f - viscous) * v[3]) + g) * a.kick_dt * space;
    w += (t - (viscous_spin * x[3] * x[3]) * (space * w)) * (w[3] * a.kick_dt);
    x += v * (space * a.dt);
    const Four v2 = v * v;
    const double speed2 = v2[0] + v2[1] + v2[2];
    if (!(speed2 <= fastest)) fastest = speed2;
    f = Four{0.0, 0.0, 0.0, 0.0};
    t = Four{0.0, 0.0, 0.0, 0.0};
  }
  return fastest;
}

}  // namespace terrode::dem::TERRODE_KERNEL_ISA
