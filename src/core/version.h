#pragma once
namespace terrode {
// The release, "0.1.0", and the commit it was built from ("unknown" outside a repository).
const char* version();
const char* commit();
}  // namespace terrode
