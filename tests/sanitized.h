// Whether a sanitizer is built in: it reserves more address space than any limit leaves, and brings its own operator new.
// clang tells of it in another way than gcc.
#pragma once

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define TERRODE_SANITIZED 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define TERRODE_SANITIZED 1
#endif
#endif
#ifndef TERRODE_SANITIZED
#define TERRODE_SANITIZED 0
#endif

namespace terrode {

inline constexpr bool kSanitized = TERRODE_SANITIZED;

}  // namespace terrode
