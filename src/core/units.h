// Physical units as they stand in files ("130 mm", "17 deg/s", "kN/m^3") and what they are in SI.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>

namespace terrode {

// Powers of metre, kilogram, second, ampere and kelvin. The radian is dimensionless, as in SI; powers may be broken
// (Bekker's kphi has N/m^(n+2)).
using Dimension = std::array<double, 5>;

// A unit: its dimension and the factor that takes a number in it to SI. (No offsets: degC is not a unit here.)
struct Unit {
  Dimension dimension{};
  double to_si = 1.0;
  bool angle = false;  // contains an angle unit (rad, deg, rev): so that "3 deg" is refused where a count is meant
};

// Reads a unit expression: names with SI prefixes, joined by space, "*", "·" or "/", powers by ^ or a trailing digit,
// parentheses after "/". "" and "-" are dimensionless. Returns nothing if it cannot be read.
std::optional<Unit> parse_unit(std::string_view text);

// True if both have the same dimension.
bool same_dimension(const Unit& a, const Unit& b);

// Result of reading "130 mm": the value in SI, or a message that says what is wrong ("has unit kg").
struct QuantityText {
  double value = 0.0;
  std::string error;     // empty when read
  bool had_unit = false; // false for a bare number, taken as SI
};

// Reads a number with an optional unit and returns it in the SI unit `si_unit` (e.g. "m", "rad/s", "-").
// A bare number is in SI already. Not-finite numbers are an error.
QuantityText parse_quantity(std::string_view text, std::string_view si_unit);

// Reads a whole string as a finite double with '.' as decimal point, independent of the locale; nothing on failure.
std::optional<double> parse_number(std::string_view text);

}  // namespace terrode
