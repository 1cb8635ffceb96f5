#include "dem/kernel.h"

#include <string>

#include "core/problem.h"

namespace terrode::dem {

extern const Kernels generic_kernels;
#if defined(__x86_64__)
extern const Kernels avx2_kernels;
extern const Kernels avx512_kernels;
#endif

const Kernels& kernels(const char* name) {
  const std::string asked = name == nullptr ? "" : name;
  if (asked == "generic") return generic_kernels;
#if defined(__x86_64__)
  const bool has_512 =
      __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl");
  const bool has_avx2 = __builtin_cpu_supports("avx2");
  if ((asked.empty() || asked == "avx512") && has_512) return avx512_kernels;
  if ((asked.empty() || asked == "avx2") && has_avx2) return avx2_kernels;
#endif
  if (asked.empty()) return generic_kernels;
  throw InputError("kernel \"" + asked + "\" does not run on this processor");
}

}  // namespace terrode::dem
