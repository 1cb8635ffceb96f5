// Several doubles at a time, with the operations a contact law is written in. The same law source is compiled with
// T = double (one contact, and what a GPU thread would run) and with T = Pack (as many contacts as the vector unit is
// wide). Only + - * / sqrt, comparisons and selections are used and contraction is off, so that every width gives the
// same digits.
#pragma once

#include <cmath>

#if defined(__SSE2__)
#include <immintrin.h>
#endif

#if defined(__CUDACC__) || defined(__HIPCC__)
#define TERRODE_KERNEL __host__ __device__ inline
#else
#define TERRODE_KERNEL inline __attribute__((always_inline))
#endif

namespace terrode::dem {

// One lane.
TERRODE_KERNEL double splat(double x, double) { return x; }
TERRODE_KERNEL double square_root(double a) { return std::sqrt(a); }
TERRODE_KERNEL double absolute(double a) { return a < 0.0 ? -a : a; }
TERRODE_KERNEL double smaller(double a, double b) { return a < b ? a : b; }
TERRODE_KERNEL double larger(double a, double b) { return a > b ? a : b; }
TERRODE_KERNEL double select(bool m, double a, double b) { return m ? a : b; }

}  // namespace terrode::dem

// Set by the translation units that hold kernels (kernel_*.cpp), each compiled for its own instruction set.
#ifdef TERRODE_KERNEL_WIDTH
namespace terrode::dem::TERRODE_KERNEL_ISA {

#if TERRODE_KERNEL_WIDTH == 8
struct Mask {
  __mmask8 m;
};
struct Pack {
  static constexpr int width = 8;
  __m512d v;
  Pack() = default;
  TERRODE_KERNEL Pack(__m512d x) : v(x) {}
  TERRODE_KERNEL Pack(double x) : v(_mm512_set1_pd(x)) {}
  TERRODE_KERNEL static Pack load(const double* p) { return _mm512_loadu_pd(p); }
  TERRODE_KERNEL void store(double* p) const { _mm512_storeu_pd(p, v); }
};
TERRODE_KERNEL Pack operator+(Pack a, Pack b) { return _mm512_add_pd(a.v, b.v); }
TERRODE_KERNEL Pack operator-(Pack a, Pack b) { return _mm512_sub_pd(a.v, b.v); }
TERRODE_KERNEL Pack operator*(Pack a, Pack b) { return _mm512_mul_pd(a.v, b.v); }
TERRODE_KERNEL Pack operator/(Pack a, Pack b) { return _mm512_div_pd(a.v, b.v); }
TERRODE_KERNEL Pack square_root(Pack a) { return _mm512_sqrt_pd(a.v); }
TERRODE_KERNEL Pack absolute(Pack a) { return _mm512_abs_pd(a.v); }
TERRODE_KERNEL Pack smaller(Pack a, Pack b) { return _mm512_min_pd(a.v, b.v); }
TERRODE_KERNEL Pack larger(Pack a, Pack b) { return _mm512_max_pd(a.v, b.v); }
TERRODE_KERNEL Mask operator<(Pack a, Pack b) { return {_mm512_cmp_pd_mask(a.v, b.v, _CMP_LT_OQ)}; }
TERRODE_KERNEL Mask operator>(Pack a, Pack b) { return {_mm512_cmp_pd_mask(a.v, b.v, _CMP_GT_OQ)}; }
TERRODE_KERNEL Mask operator&(Mask a, Mask b) { return {static_cast<__mmask8>(a.m & b.m)}; }
TERRODE_KERNEL Pack select(Mask m, Pack a, Pack b) { return _mm512_mask_blend_pd(m.m, b.v, a.v); }
TERRODE_KERNEL unsigned bits(Mask m) { return m.m; }
// Lanes [0, n) set.
TERRODE_KERNEL Mask first_lanes(int n) { return {static_cast<__mmask8>(n >= 8 ? 0xFF : (1 << n) - 1)}; }

// out[c] lane k = base[4 index[k] + c]: a column of four for each of eight records.
TERRODE_KERNEL void load_records(const double* base, const int* index, Pack* out) {
  const auto two = [&](int k) {
    const __m256d lo = _mm256_loadu_pd(base + 4 * static_cast<long>(index[k]));
    return _mm512_insertf64x4(_mm512_castpd256_pd512(lo), _mm256_loadu_pd(base + 4 * static_cast<long>(index[k + 4])),
                              1);
  };
  const __m512d a = two(0), b = two(1), c = two(2), d = two(3);
  const __m512d ab02 = _mm512_unpacklo_pd(a, b), ab13 = _mm512_unpackhi_pd(a, b);
  const __m512d cd02 = _mm512_unpacklo_pd(c, d), cd13 = _mm512_unpackhi_pd(c, d);
  const __m512i low = _mm512_setr_epi64(0, 1, 8, 9, 4, 5, 12, 13), high = _mm512_setr_epi64(2, 3, 10, 11, 6, 7, 14, 15);
  out[0] = _mm512_permutex2var_pd(ab02, low, cd02);
  out[1] = _mm512_permutex2var_pd(ab13, low, cd13);
  out[2] = _mm512_permutex2var_pd(ab02, high, cd02);
  out[3] = _mm512_permutex2var_pd(ab13, high, cd13);
}
// buffer[stride k + c] = in_c lane k.
TERRODE_KERNEL void store_records(Pack a, Pack b, Pack c, Pack d, double* buffer, int stride) {
  const __m512d ab02 = _mm512_unpacklo_pd(a.v, b.v), ab13 = _mm512_unpackhi_pd(a.v, b.v);
  const __m512d cd02 = _mm512_unpacklo_pd(c.v, d.v), cd13 = _mm512_unpackhi_pd(c.v, d.v);
  const __m512i low = _mm512_setr_epi64(0, 1, 8, 9, 4, 5, 12, 13), high = _mm512_setr_epi64(2, 3, 10, 11, 6, 7, 14, 15);
  const __m512d r04 = _mm512_permutex2var_pd(ab02, low, cd02), r15 = _mm512_permutex2var_pd(ab13, low, cd13);
  const __m512d r26 = _mm512_permutex2var_pd(ab02, high, cd02), r37 = _mm512_permutex2var_pd(ab13, high, cd13);
  _mm256_storeu_pd(buffer, _mm512_castpd512_pd256(r04));
  _mm256_storeu_pd(buffer + stride, _mm512_castpd512_pd256(r15));
  _mm256_storeu_pd(buffer + 2 * stride, _mm512_castpd512_pd256(r26));
  _mm256_storeu_pd(buffer + 3 * stride, _mm512_castpd512_pd256(r37));
  _mm256_storeu_pd(buffer + 4 * stride, _mm512_extractf64x4_pd(r04, 1));
  _mm256_storeu_pd(buffer + 5 * stride, _mm512_extractf64x4_pd(r15, 1));
  _mm256_storeu_pd(buffer + 6 * stride, _mm512_extractf64x4_pd(r26, 1));
  _mm256_storeu_pd(buffer + 7 * stride, _mm512_extractf64x4_pd(r37, 1));
}

#elif TERRODE_KERNEL_WIDTH == 4
struct Mask {
  __m256d m;
};
struct Pack {
  static constexpr int width = 4;
  __m256d v;
  Pack() = default;
  TERRODE_KERNEL Pack(__m256d x) : v(x) {}
  TERRODE_KERNEL Pack(double x) : v(_mm256_set1_pd(x)) {}
  TERRODE_KERNEL static Pack load(const double* p) { return _mm256_loadu_pd(p); }
  TERRODE_KERNEL void store(double* p) const { _mm256_storeu_pd(p, v); }
};
TERRODE_KERNEL Pack operator+(Pack a, Pack b) { return _mm256_add_pd(a.v, b.v); }
TERRODE_KERNEL Pack operator-(Pack a, Pack b) { return _mm256_sub_pd(a.v, b.v); }
TERRODE_KERNEL Pack operator*(Pack a, Pack b) { return _mm256_mul_pd(a.v, b.v); }
TERRODE_KERNEL Pack operator/(Pack a, Pack b) { return _mm256_div_pd(a.v, b.v); }
TERRODE_KERNEL Pack square_root(Pack a) { return _mm256_sqrt_pd(a.v); }
TERRODE_KERNEL Pack absolute(Pack a) { return _mm256_andnot_pd(_mm256_set1_pd(-0.0), a.v); }
TERRODE_KERNEL Pack smaller(Pack a, Pack b) { return _mm256_min_pd(a.v, b.v); }
TERRODE_KERNEL Pack larger(Pack a, Pack b) { return _mm256_max_pd(a.v, b.v); }
TERRODE_KERNEL Mask operator<(Pack a, Pack b) { return {_mm256_cmp_pd(a.v, b.v, _CMP_LT_OQ)}; }
TERRODE_KERNEL Mask operator>(Pack a, Pack b) { return {_mm256_cmp_pd(a.v, b.v, _CMP_GT_OQ)}; }
TERRODE_KERNEL Mask operator&(Mask a, Mask b) { return {_mm256_and_pd(a.m, b.m)}; }
TERRODE_KERNEL Pack select(Mask m, Pack a, Pack b) { return _mm256_blendv_pd(b.v, a.v, m.m); }
TERRODE_KERNEL unsigned bits(Mask m) { return static_cast<unsigned>(_mm256_movemask_pd(m.m)); }
TERRODE_KERNEL Mask first_lanes(int n) {
  return {_mm256_cmp_pd(_mm256_setr_pd(0, 1, 2, 3), _mm256_set1_pd(n), _CMP_LT_OQ)};
}
TERRODE_KERNEL void transpose(__m256d& a, __m256d& b, __m256d& c, __m256d& d) {
  const __m256d ab02 = _mm256_unpacklo_pd(a, b), ab13 = _mm256_unpackhi_pd(a, b);
  const __m256d cd02 = _mm256_unpacklo_pd(c, d), cd13 = _mm256_unpackhi_pd(c, d);
  a = _mm256_permute2f128_pd(ab02, cd02, 0x20);
  b = _mm256_permute2f128_pd(ab13, cd13, 0x20);
  c = _mm256_permute2f128_pd(ab02, cd02, 0x31);
  d = _mm256_permute2f128_pd(ab13, cd13, 0x31);
}
TERRODE_KERNEL void load_records(const double* base, const int* index, Pack* out) {
  for (int k = 0; k < 4; ++k) out[k].v = _mm256_loadu_pd(base + 4 * static_cast<long>(index[k]));
  transpose(out[0].v, out[1].v, out[2].v, out[3].v);
}
TERRODE_KERNEL void store_records(Pack a, Pack b, Pack c, Pack d, double* buffer, int stride) {
  transpose(a.v, b.v, c.v, d.v);
  a.store(buffer);
  b.store(buffer + stride);
  c.store(buffer + 2 * stride);
  d.store(buffer + 3 * stride);
}

#elif TERRODE_KERNEL_WIDTH == 2
struct Mask {
  __m128d m;
};
struct Pack {
  static constexpr int width = 2;
  __m128d v;
  Pack() = default;
  TERRODE_KERNEL Pack(__m128d x) : v(x) {}
  TERRODE_KERNEL Pack(double x) : v(_mm_set1_pd(x)) {}
  TERRODE_KERNEL static Pack load(const double* p) { return _mm_loadu_pd(p); }
  TERRODE_KERNEL void store(double* p) const { _mm_storeu_pd(p, v); }
};
TERRODE_KERNEL Pack operator+(Pack a, Pack b) { return _mm_add_pd(a.v, b.v); }
TERRODE_KERNEL Pack operator-(Pack a, Pack b) { return _mm_sub_pd(a.v, b.v); }
TERRODE_KERNEL Pack operator*(Pack a, Pack b) { return _mm_mul_pd(a.v, b.v); }
TERRODE_KERNEL Pack operator/(Pack a, Pack b) { return _mm_div_pd(a.v, b.v); }
TERRODE_KERNEL Pack square_root(Pack a) { return _mm_sqrt_pd(a.v); }
TERRODE_KERNEL Pack absolute(Pack a) { return _mm_andnot_pd(_mm_set1_pd(-0.0), a.v); }
TERRODE_KERNEL Pack smaller(Pack a, Pack b) { return _mm_min_pd(a.v, b.v); }
TERRODE_KERNEL Pack larger(Pack a, Pack b) { return _mm_max_pd(a.v, b.v); }
TERRODE_KERNEL Mask operator<(Pack a, Pack b) { return {_mm_cmplt_pd(a.v, b.v)}; }
TERRODE_KERNEL Mask operator>(Pack a, Pack b) { return {_mm_cmpgt_pd(a.v, b.v)}; }
TERRODE_KERNEL Mask operator&(Mask a, Mask b) { return {_mm_and_pd(a.m, b.m)}; }
TERRODE_KERNEL Pack select(Mask m, Pack a, Pack b) { return _mm_or_pd(_mm_and_pd(m.m, a.v), _mm_andnot_pd(m.m, b.v)); }
TERRODE_KERNEL unsigned bits(Mask m) { return static_cast<unsigned>(_mm_movemask_pd(m.m)); }
TERRODE_KERNEL Mask first_lanes(int n) { return {_mm_cmplt_pd(_mm_setr_pd(0, 1), _mm_set1_pd(n))}; }
TERRODE_KERNEL void load_records(const double* base, const int* index, Pack* out) {
  const double* p = base + 4 * static_cast<long>(index[0]);
  const double* q = base + 4 * static_cast<long>(index[1]);
  for (int h = 0; h < 2; ++h) {
    const __m128d a = _mm_loadu_pd(p + 2 * h), b = _mm_loadu_pd(q + 2 * h);
    out[2 * h].v = _mm_unpacklo_pd(a, b);
    out[2 * h + 1].v = _mm_unpackhi_pd(a, b);
  }
}
TERRODE_KERNEL void store_records(Pack a, Pack b, Pack c, Pack d, double* buffer, int stride) {
  _mm_storeu_pd(buffer, _mm_unpacklo_pd(a.v, b.v));
  _mm_storeu_pd(buffer + 2, _mm_unpacklo_pd(c.v, d.v));
  _mm_storeu_pd(buffer + stride, _mm_unpackhi_pd(a.v, b.v));
  _mm_storeu_pd(buffer + stride + 2, _mm_unpackhi_pd(c.v, d.v));
}

#else
// Any processor: one lane.
struct Mask {
  bool m;
};
struct Pack {
  static constexpr int width = 1;
  double v;
  Pack() = default;
  TERRODE_KERNEL Pack(double x) : v(x) {}
  TERRODE_KERNEL static Pack load(const double* p) { return *p; }
  TERRODE_KERNEL void store(double* p) const { *p = v; }
};
TERRODE_KERNEL Pack operator+(Pack a, Pack b) { return a.v + b.v; }
TERRODE_KERNEL Pack operator-(Pack a, Pack b) { return a.v - b.v; }
TERRODE_KERNEL Pack operator*(Pack a, Pack b) { return a.v * b.v; }
TERRODE_KERNEL Pack operator/(Pack a, Pack b) { return a.v / b.v; }
TERRODE_KERNEL Pack square_root(Pack a) { return std::sqrt(a.v); }
TERRODE_KERNEL Pack absolute(Pack a) { return a.v < 0.0 ? -a.v : a.v; }
TERRODE_KERNEL Pack smaller(Pack a, Pack b) { return a.v < b.v ? a.v : b.v; }
TERRODE_KERNEL Pack larger(Pack a, Pack b) { return a.v > b.v ? a.v : b.v; }
TERRODE_KERNEL Mask operator<(Pack a, Pack b) { return {a.v < b.v}; }
TERRODE_KERNEL Mask operator>(Pack a, Pack b) { return {a.v > b.v}; }
TERRODE_KERNEL Mask operator&(Mask a, Mask b) { return {a.m && b.m}; }
TERRODE_KERNEL Pack select(Mask m, Pack a, Pack b) { return m.m ? a : b; }
TERRODE_KERNEL unsigned bits(Mask m) { return m.m ? 1u : 0u; }
TERRODE_KERNEL Mask first_lanes(int n) { return {n > 0}; }
TERRODE_KERNEL void load_records(const double* base, const int* index, Pack* out) {
  for (int c = 0; c < 4; ++c) out[c] = base[4 * static_cast<long>(index[0]) + c];
}
TERRODE_KERNEL void store_records(Pack a, Pack b, Pack c, Pack d, double* buffer, int) {
  buffer[0] = a.v;
  buffer[1] = b.v;
  buffer[2] = c.v;
  buffer[3] = d.v;
}
#endif

}  // namespace terrode::dem::TERRODE_KERNEL_ISA
#endif
