// Missing physics as parts. Each effect is one file: what it is, where it hooks in, and its parameters, whose null value
// leaves every model exactly as it was. list.cpp names them all.
//
// An effect may act in three places, in this order:
//   soil or wheel   a bekker::StressModifier: contact geometry, soil parameters, pressure, shear, wedge traction; the
//                   steady wheel and every node of the node-spring terrain call the same hooks;
//   bed             bed_height(): the surface the wheel meets. The steady wheel has no bed, so quasi_static() says what
//                   the bed does to a wheel that follows it slowly;
//   rig, sensor     measure(): what the recording shows of what acted.
// Several effects compose in the order of list.cpp, whatever the order in a file.
#pragma once

#include <array>
#include <limits>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "bekker/point_law.h"
#include "core/problem.h"

namespace terrode::effects {

enum class Class { compaction, shear, wedge, bed, wheel, rig, numerics };
const char* class_name(Class c);

// How a parameter is best varied: `linear` around its null, `log` (positive, null at 0 or infinity not included),
// `inverse` (null at infinity: 1/p is linear), `choice` (a whole number that selects).
enum class Scale { linear, log, inverse, choice };

struct Parameter {
  std::string_view name;
  std::string_view unit;      // SI, "-" without dimension
  double null_value;     // leaves the model as it was, whatever the other parameters
  double lower, upper;   // bounds, SI
  double typical;        // a strength seen in the literature
  double prior_scale;    // width of a literature prior around the null (strengths) or the typical value (shapes)
  Scale scale;
  bool strength;         // the null value of this parameter alone switches the effect off
  std::string_view meaning;
  bool fitted = true;    // false: means of a wheel cannot tell it, so a search leaves it at what its start gives
};

// What the effect at its typical strength does to steady means, and with what it varies. The means are those of a wheel
// of 130 mm by 160 mm at s = 0.3 under 115 N on Mojave Martian Simulant with K = 8 mm, third pass, 0.2 m along a run of
// 0.7 m, 5 s after its start. `pull`, `torque`, `sinkage`: +1 or -1, the change (relative to W, W r and z) has this sign,
// at half and twice the load too; 0, it is none or less than 0.22 of that in the channel that changes most.
// `with_...`: whether the effect (not the wheel without it) differs with speed, pass, position, time or wheel angle;
// ripples do not show in means (Context::phase_average), trends along the bed or in time do.
struct Fingerprint {
  int pull, torque, sinkage;  // sign of the change; 0: none
  bool with_speed, with_pass, with_position, with_time, with_angle;
  std::string_view text;
};

// What is known of a recording before an effect is looked for in it.
struct Surroundings {
  double radius = 0.0;          // of the wheel, m
  double friction_angle = 0.0;  // believed, rad
  double lugs = 0.0;            // around the wheel, as given or as a line in the series shows; 0: none
  bool lugs_would_show = false; // enough series that lugs would have left a line
};

// Parameters by name, SI; those that are left out begin at the null value (strengths) or at the prior.
using Start = std::map<std::string, double>;

// A number that belongs to the recording and not to the law, fitted with the effect.
struct Beside {
  std::string_view name;
  double lower, upper, prior_mean, prior_deviation;
};

// How an effect is looked for in a recording.
struct Search {
  // Where fits begin, several where the law has several valleys; none returned: the effect is out of the question.
  // Without the function there is one start, at the null. Forms of a law (`choice`) are all tried beside.
  std::vector<Start> (*starts)(const Surroundings&) = nullptr;
  std::vector<Beside> beside = {};
  bool in_soil_tests = false;  // belongs to the soil itself and so acts in its plate and shear tests too
  bool ripple_alone = false;   // its means are nil: only a line in the series shows it
  bool needs_series = false;   // a table of means cannot show it
  bool exact = false;          // statics or a constant of a sensor: what it leaves over is another cause, and no other form of it
};

struct Info {
  std::string_view id;
  Class cls;
  std::string_view name;      // the field's name
  std::string_view physics;   // one paragraph
  std::string_view equation;
  std::string_view source;
  std::vector<Parameter> parameters;
  std::string_view hook;      // pressure, shear, contact geometry, wedge forces, bed, wheel, rig, sensor, time
  Fingerprint fingerprint;
  std::vector<std::string_view> confused_with;
  std::string_view separated_by;  // the experiment that tells them apart
  // Why a simulation in time parts from the steady means by more than a twentieth of the change; empty: it does not.
  std::string_view parts_in_time = {};
  Search search = {};
  // Of an effect of the rig that acts: where its energy comes from or goes. Empty: soil or bed take it, or nothing acts and
  // a sensor only shows something else.
  std::string_view energy = {};
};

// One instant of a run, as the rig and its sensors see it.
struct Sample {
  double time = 0.0;         // s from the start of the run
  double position = 0.0;     // x of the wheel from its start, m
  double wheel_angle = 0.0;  // rad turned
  double time_step = 0.0;    // s since the last sample; 0 at the first and for a steady mean
  bekker::Context context;
};

// What the channels of a recording show.
struct Reading {
  double drawbar_pull = 0.0;    // N
  double driving_torque = 0.0;  // N m
  double sinkage = 0.0;         // m
  double normal_load = 0.0;     // N
};

// What a sensor remembers from sample to sample; owned by whoever runs a series, zero at its start.
struct SensorState {
  std::array<double, 4> memory{};
  bool started = false;
};

class Effect : public bekker::StressModifier {
 public:
  Effect(const Info& info, std::vector<double> values) : info_(&info), values_(std::move(values)) {}
  const Info& info() const { return *info_; }
  // In the order of info().parameters, SI.
  const std::vector<double>& values() const { return values_; }
  // True when a strength stands at its null value: the effect then does nothing.
  bool is_null() const;

  unsigned hooks() const override { return 0; }
  // True for what a simulated rig does itself, by the load and the slip that it gives the wheel: the ground leaves it out.
  virtual bool carried_by_rig() const { return false; }
  virtual double bed_height(double /*x*/) const { return 0.0; }  // m, added to the ground's height
  virtual bool has_bed() const { return false; }
  virtual void quasi_static(const Sample&, Reading&) const {}
  virtual bool measures() const { return false; }
  virtual void measure(const Sample&, Reading&, SensorState&) const {}
  // For models that know no transients: true when the effect is that a run approaches its steady mean, and what it has
  // reached after `rim_path` [m]; `beside` in the order of Search::beside.
  virtual bool settles() const { return false; }
  virtual void settle(double /*rim_path*/, std::span<const double> /*beside*/, Reading&) const {}

 protected:
  double p(std::size_t i) const { return values_[i]; }

 private:
  const Info* info_;
  std::vector<double> values_;
};

// An effect that can be made: its description and a factory.
struct EffectType {
  const Info* info;
  std::unique_ptr<Effect> (*make)(std::vector<double> values);
};

// Every effect, in the order in which they act.
const std::vector<EffectType>& all_effects();

// The effect with this id, or nullptr.
const EffectType* find_effect(const std::string& id);

// Effects that are switched on, ready for the models. Copying shares the effects, which never change.
class EffectSet {
 public:
  EffectSet() = default;

  // From ids and parameters in SI; a parameter that is not given has its typical value (so naming an effect alone
  // switches it on). Throws InputError for an unknown id (with the nearest), an unknown parameter, a value out of bounds
  // or an effect given twice. Effects at their null value are left out: the model is then bit for bit the plain one.
  explicit EffectSet(const std::map<std::string, std::map<std::string, double>>& effects);

  bool empty() const { return effects_.empty(); }
  std::span<const std::shared_ptr<const Effect>> effects() const { return effects_; }

  // The soil and wheel parts, for bekker::PointLaw; valid while this set or a copy of it lives.
  std::span<const bekker::StressModifier* const> modifiers() const { return modifiers_; }

  // Those that a ground under a simulated rig applies: all but what the rig carries.
  EffectSet for_ground() const;
  // Load on the soil and slip that the soil sees when the rig has `context`, by the effects that a rig carries.
  bekker::ContactShape carried_by_rig(const bekker::Context& context) const;

  bool has_bed() const;
  double bed_height(double x) const;                                // m, sum of all
  void quasi_static(const Sample& sample, Reading& reading) const;  // bed effects on a wheel without a bed
  bool measures() const;
  // Rig and sensor effects in order; `states` has one entry per effect and starts zero.
  void measure(const Sample& sample, Reading& reading, std::span<SensorState> states) const;
  // The same for one sample by itself: sensors have settled.
  void measure(const Sample& sample, Reading& reading) const;
  // True when soil or wheel feel more of an operating point than slip, load, speed and pass: its position, its time or
  // the angle the wheel has turned. Else one steady solution serves a whole run.
  bool soil_varies() const;
  std::size_t size() const { return effects_.size(); }

 private:
  std::vector<std::shared_ptr<const Effect>> effects_;
  std::vector<const bekker::StressModifier*> modifiers_;
};

namespace detail {
template <class E, const Info& (*info)()>
EffectType type_of() {
  return {&info(), [](std::vector<double> values) -> std::unique_ptr<Effect> { return std::make_unique<E>(info(), std::move(values)); }};
}
}  // namespace detail

inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace terrode::effects
