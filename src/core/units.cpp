#include "core/units.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <numbers>

namespace terrode {
namespace {

struct Named {
  std::string_view name;
  Unit unit;
  bool prefixes;
};

constexpr Dimension kNone{0, 0, 0, 0, 0};
constexpr double kPi = std::numbers::pi;

// Mass is listed as gram so that prefixes work; its factor is 1e-3.
const Named kUnits[] = {
    {"m", {{1, 0, 0, 0, 0}, 1.0, false}, true},
    {"g", {{0, 1, 0, 0, 0}, 1e-3, false}, true},
    {"s", {{0, 0, 1, 0, 0}, 1.0, false}, true},
    {"A", {{0, 0, 0, 1, 0}, 1.0, false}, true},
    {"K", {{0, 0, 0, 0, 1}, 1.0, false}, false},
    {"N", {{1, 1, -2, 0, 0}, 1.0, false}, true},
    {"Nm", {{2, 1, -2, 0, 0}, 1.0, false}, false},
    {"kNm", {{2, 1, -2, 0, 0}, 1e3, false}, false},
    {"mNm", {{2, 1, -2, 0, 0}, 1e-3, false}, false},
    {"Nmm", {{2, 1, -2, 0, 0}, 1e-3, false}, false},
    {"Pa", {{-1, 1, -2, 0, 0}, 1.0, false}, true},
    {"bar", {{-1, 1, -2, 0, 0}, 1e5, false}, true},
    {"psi", {{-1, 1, -2, 0, 0}, 6894.757293168361, false}, false},
    {"J", {{2, 1, -2, 0, 0}, 1.0, false}, true},
    {"W", {{2, 1, -3, 0, 0}, 1.0, false}, true},
    {"V", {{2, 1, -3, -1, 0}, 1.0, false}, true},
    {"Ohm", {{2, 1, -3, -2, 0}, 1.0, false}, true},
    {"H", {{2, 1, -2, -2, 0}, 1.0, false}, true},
    {"Hz", {{0, 0, -1, 0, 0}, 1.0, false}, true},
    {"rad", {kNone, 1.0, true}, true},
    {"deg", {kNone, kPi / 180.0, true}, false},
    {"°", {kNone, kPi / 180.0, true}, false},
    {"rev", {kNone, 2.0 * kPi, true}, false},
    {"rpm", {{0, 0, -1, 0, 0}, 2.0 * kPi / 60.0, true}, false},
    {"%", {kNone, 0.01, false}, false},
    {"min", {{0, 0, 1, 0, 0}, 60.0, false}, false},
    {"h", {{0, 0, 1, 0, 0}, 3600.0, false}, false},
    {"t", {{0, 1, 0, 0, 0}, 1e3, false}, false},
    {"lb", {{0, 1, 0, 0, 0}, 0.45359237, false}, false},
    {"lbf", {{1, 1, -2, 0, 0}, 4.4482216152605, false}, false},
    {"kgf", {{1, 1, -2, 0, 0}, 9.80665, false}, false},
    {"in", {{1, 0, 0, 0, 0}, 0.0254, false}, false},
    {"ft", {{1, 0, 0, 0, 0}, 0.3048, false}, false},
};

struct Prefix {
  std::string_view name;
  double factor;
};
const Prefix kPrefixes[] = {{"G", 1e9},  {"M", 1e6},  {"k", 1e3},  {"c", 1e-2},  {"d", 1e-1},
                            {"m", 1e-3}, {"u", 1e-6}, {"µ", 1e-6}, {"μ", 1e-6}, {"n", 1e-9}};

std::optional<Unit> lookup(std::string_view name) {
  for (const Named& u : kUnits)
    if (u.name == name) return u.unit;
  for (const Prefix& p : kPrefixes) {
    if (!name.starts_with(p.name)) continue;
    const std::string_view rest = name.substr(p.name.size());
    for (const Named& u : kUnits) {
      if (u.prefixes && u.name == rest) {
        Unit out = u.unit;
        out.to_si *= p.factor;
        return out;
      }
    }
  }
  return std::nullopt;
}

void raise(Unit& unit, double power) {
  for (double& d : unit.dimension) d *= power;
  unit.to_si = std::pow(unit.to_si, power);
}

void multiply(Unit& into, const Unit& by, double sign) {
  for (size_t i = 0; i < into.dimension.size(); ++i) into.dimension[i] += sign * by.dimension[i];
  into.to_si = sign > 0 ? into.to_si * by.to_si : into.to_si / by.to_si;
  into.angle = into.angle || by.angle;
}

class UnitReader {
 public:
  explicit UnitReader(std::string_view text) : rest_(text) {}

  std::optional<Unit> read() {
    auto unit = product();
    skip();
    if (!unit || !rest_.empty()) return std::nullopt;
    return unit;
  }

 private:
  void skip() {
    while (!rest_.empty() && (rest_.front() == ' ' || rest_.front() == '\t')) rest_.remove_prefix(1);
  }
  bool take(std::string_view token) {
    if (!rest_.starts_with(token)) return false;
    rest_.remove_prefix(token.size());
    return true;
  }
  std::optional<Unit> product() {
    auto unit = power();
    if (!unit) return std::nullopt;
    for (;;) {
      skip();
      if (rest_.empty() || rest_.front() == ')') return unit;
      const double sign = take("/") ? -1.0 : 1.0;
      if (sign > 0 && !take("*")) take("·");
      const auto next = power();
      if (!next) return std::nullopt;
      multiply(*unit, *next, sign);
    }
  }
  std::optional<Unit> power() {
    skip();
    std::optional<Unit> unit;
    if (take("(")) {
      if (++depth_ > 8) return std::nullopt;
      unit = product();
      --depth_;
      skip();
      if (!unit || !take(")")) return std::nullopt;
    } else if (take("1")) {
      unit = Unit{};
    } else {
      size_t n = 0;
      while (n < rest_.size() && (std::isalpha(static_cast<unsigned char>(rest_[n])) || (rest_[n] & 0x80) || rest_[n] == '%') &&
             !rest_.substr(n).starts_with("·") && !rest_.substr(n).starts_with("²") && !rest_.substr(n).starts_with("³"))
        ++n;
      if (n == 0) return std::nullopt;
      unit = lookup(rest_.substr(0, n));
      rest_.remove_prefix(n);
      if (!unit) return std::nullopt;
    }
    if (take("²")) raise(*unit, 2.0);
    if (take("³")) raise(*unit, 3.0);
    const bool caret = take("^");
    const bool paren = caret && take("(");
    size_t n = 0;
    if (n < rest_.size() && (rest_[n] == '-' || rest_[n] == '+')) ++n;
    while (n < rest_.size() && (std::isdigit(static_cast<unsigned char>(rest_[n])) || (caret && rest_[n] == '.'))) ++n;
    const std::string_view digits = rest_.substr(0, n);
    const bool has_digit = digits.find_first_of("0123456789") != std::string_view::npos;
    if (caret && !has_digit) return std::nullopt;
    if (has_digit) {
      const auto p = parse_number(digits.front() == '+' ? digits.substr(1) : digits);
      if (!p || std::abs(*p) > 9) return std::nullopt;
      raise(*unit, *p);
      rest_.remove_prefix(n);
    }
    if (paren && !take(")")) return std::nullopt;
    return unit;
  }
  std::string_view rest_;
  int depth_ = 0;
};

std::string_view trim(std::string_view s) {
  while (!s.empty() && std::isspace(static_cast<unsigned char>(s.front()))) s.remove_prefix(1);
  while (!s.empty() && std::isspace(static_cast<unsigned char>(s.back()))) s.remove_suffix(1);
  return s;
}

}  // namespace

std::optional<double> parse_number(std::string_view text) {
  text = trim(text);
  if (text.starts_with('+')) text.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

std::optional<Unit> parse_unit(std::string_view text) {
  text = trim(text);
  if (text.empty() || text == "-" || text == "1") return Unit{};
  if (text.size() > 64) return std::nullopt;
  return UnitReader(text).read();
}

bool same_dimension(const Unit& a, const Unit& b) {
  for (size_t i = 0; i < a.dimension.size(); ++i)
    if (std::abs(a.dimension[i] - b.dimension[i]) > 1e-9) return false;
  return true;
}

QuantityText parse_quantity(std::string_view text, std::string_view si_unit) {
  QuantityText out;
  text = trim(text);
  size_t n = 0;
  // The longest leading piece that reads as a number; "1e3" must win over "1" followed by a unit "e3".
  for (size_t k = std::min<size_t>(text.size(), 40); k > 0; --k) {
    const char last = text[k - 1];
    if (!std::isdigit(static_cast<unsigned char>(last)) && last != '.') continue;
    if (const auto v = parse_number(text.substr(0, k))) {
      out.value = *v;
      n = k;
      break;
    }
  }
  if (n == 0) {
    out.error = fmt::format("is '{}', not a finite number", text.substr(0, 60));
    return out;
  }
  const std::string_view unit_text = trim(text.substr(n));
  if (unit_text.empty()) return out;
  out.had_unit = true;
  const auto wanted = parse_unit(si_unit);
  const auto given = parse_unit(unit_text);
  if (!given) {
    out.error = fmt::format("is '{}', whose unit '{}' is not known", text.substr(0, 60), unit_text.substr(0, 40));
  } else if (!wanted || !same_dimension(*wanted, *given) || (given->angle && !wanted->angle && si_unit != "1/s")) {
    out.error = fmt::format("is '{}', whose unit cannot be converted", text.substr(0, 60));
  } else {
    out.value *= given->to_si;
    if (!std::isfinite(out.value)) out.error = fmt::format("is '{}', out of range", text.substr(0, 60));
  }
  return out;
}

}  // namespace terrode
