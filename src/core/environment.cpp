#include "core/environment.h"

#include <cstdlib>

namespace terrode {

std::string environment(const char* name) {
  const char* value = std::getenv(name);  // NOLINT(concurrency-mt-unsafe): unsafe beside setenv only
  return value ? value : "";
}

}  // namespace terrode
