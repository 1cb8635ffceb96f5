// The kernels for any processor: two lanes where SSE2 is the baseline, one elsewhere.
#define TERRODE_KERNEL_ISA generic
#if defined(__SSE2__)
#define TERRODE_KERNEL_WIDTH 2
#else
#define TERRODE_KERNEL_WIDTH 1
#endif
#include "dem/kernel_body.h"

namespace terrode::dem {
extern const Kernels generic_kernels;
const Kernels generic_kernels = {"generic", TERRODE_KERNEL_WIDTH, generic::pairs, generic::drift};
}  // namespace terrode::dem
