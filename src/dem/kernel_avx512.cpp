// The kernels at eight lanes; compiled with -mavx512f -mavx512dq -mavx512vl (CMakeLists.txt), called where they exist.
#if defined(__AVX512F__)
#define TERRODE_KERNEL_ISA avx512
#define TERRODE_KERNEL_WIDTH 8
#include "dem/kernel_body.h"

namespace terrode::dem {
extern const Kernels avx512_kernels;
const Kernels avx512_kernels = {"avx512", 8, avx512::pairs, avx512::drift};
}  // namespace terrode::dem
#endif
