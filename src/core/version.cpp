#include "core/version.h"

namespace terrode {
const char* version() { return TERRODE_VERSION; }
const char* commit() { return TERRODE_COMMIT; }
}  // namespace terrode
