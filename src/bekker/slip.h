// The three meanings of "slip" that papers use, and the exact ways between them.
#pragma once

#include <optional>
#include <string>

namespace terrode::bekker {

enum class SlipConvention {
  // s = 1 - v/(omega r), either sign (Wong & Reece 1967). Inside Terrode always this one.
  wong_reece,
  // driving as above; braking s = omega r/v - 1, so that a locked wheel has s = -1.
  driving_braking,
  // s = (omega r - v)/v, as printed in Smith et al. Eq. 1.
  printed,
};

// The text of the convention as recording files write it, e.g. "s = 1 - v/(omega r)".
std::string slip_convention_text(SlipConvention convention);

// Reads that text (spaces do not matter); nothing when it is none of the three.
std::optional<SlipConvention> parse_slip_convention(const std::string& text);

// Converts a slip given in `convention` to s = 1 - v/(omega r). A locked wheel gives -infinity, a wheel spinning in
// place 1. Throws InputError for slips that no motion has (above 1 with wong_reece or driving_braking, below -1 with
// driving_braking or printed), and for non-finite ones.
double to_wong_reece(double slip, SlipConvention convention);

// The inverse. s = 1 becomes +infinity in `printed`.
double from_wong_reece(double slip, SlipConvention convention);

// s = 1 - v/(omega r) of a motion: forward velocity v [m/s], angular velocity [rad/s], radius [m]. A locked wheel
// (omega = 0, v > 0) has slip -infinity. Throws InputError when nothing moves or the wheel turns against its travel.
double slip_of_motion(double forward_velocity, double angular_velocity, double radius);

}  // namespace terrode::bekker
