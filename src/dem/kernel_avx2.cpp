// The kernels at four lanes; compiled with -mavx2 (CMakeLists.txt) and called only where the processor has it.
#if defined(__AVX2__)
#define TERRODE_KERNEL_ISA avx2
#define TERRODE_KERNEL_WIDTH 4
#include "dem/kernel_body.h"

namespace terrode::dem {
extern const Kernels avx2_kernels;
const Kernels avx2_kernels = {"avx2", 4, avx2::pairs, avx2::drift};
}  // namespace terrode::dem
#endif
