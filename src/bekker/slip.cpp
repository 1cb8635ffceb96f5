#include "bekker/slip.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/problem.h"

namespace terrode::bekker {

static constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::string slip_convention_text(SlipConvention convention) {
  switch (convention) {
    case SlipConvention::wong_reece: return "s = 1 - v/(omega r)";
    case SlipConvention::driving_braking: return "s = 1 - v/(omega r) driving, omega r/v - 1 braking";
    case SlipConvention::printed: return "s = (omega r - v)/v";
  }
  return {};
}

std::optional<SlipConvention> parse_slip_convention(const std::string& text) {
  const auto squeeze = [](std::string s) {
    std::erase_if(s, [](char c) { return c == ' ' || c == '\t'; });
    return s;
  };
  for (const SlipConvention c : {SlipConvention::wong_reece, SlipConvention::driving_braking, SlipConvention::printed})
    if (squeeze(text) == squeeze(slip_convention_text(c))) return c;
  return std::nullopt;
}

double to_wong_reece(double slip, SlipConvention convention) {
  const auto refuse = [&](const char* expected) {
    throw InputError(Problem{{}, 0, 0, "slip", fmt::format("is {} by the convention '{}'", slip, slip_convention_text(convention)), expected});
  };
  if (!std::isfinite(slip)) refuse("a finite number");
  switch (convention) {
    case SlipConvention::wong_reece:
      if (slip > 1) refuse("at most 1");
      return slip;
    case SlipConvention::driving_braking:
      if (slip > 1 || slip < -1) refuse("from -1 to 1");
      if (slip >= 0) return slip;
      // omega r/v = 1 + slip, so v/(omega r) = 1/(1 + slip).
      return slip == -1 ? -kInfinity : slip / (1 + slip);
    case SlipConvention::printed:
      if (slip < -1) refuse("at least -1");
      return slip == -1 ? -kInfinity : slip / (1 + slip);
  }
  return slip;
}

double from_wong_reece(double slip, SlipConvention convention) {
  switch (convention) {
    case SlipConvention::wong_reece: return slip;
    case SlipConvention::driving_braking:
      if (slip >= 0) return slip;
      return std::isinf(slip) ? -1.0 : slip / (1 - slip);
    case SlipConvention::printed:
      if (std::isinf(slip)) return -1.0;
      return slip == 1 ? kInfinity : slip / (1 - slip);
  }
  return slip;
}

double slip_of_motion(double v, double omega, double radius) {
  if (!std::isfinite(v) || !std::isfinite(omega) || !(radius > 0) || v < 0 || omega < 0 || (v == 0 && omega == 0))
    throw InputError(Problem{{}, 0, 0, "slip", fmt::format("of forward velocity {} m/s and angular velocity {} rad/s is not defined", v, omega),
                             "a wheel that moves forward, turns forward, or both"});
  return omega == 0 ? -kInfinity : 1.0 - v / (omega * radius);
}

}  // namespace terrode::bekker
