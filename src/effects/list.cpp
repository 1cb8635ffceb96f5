// Every effect, one line each, in the order in which they act: what the soil sees, its parameters, pressure, shear,
// wedges, bed, wheel, rig, sensors, numerics. A new effect is its own file, its declaration and its line here.
#include "effects/effect.h"

namespace terrode::effects {

EffectType slip_offset();
EffectType guide_friction();
EffectType wheel_flexibility();
EffectType rear_contact();
EffectType unloading();
EffectType slip_sinkage();
EffectType multi_pass();
EffectType plate_scale();
EffectType gravity();
EffectType density_gradient();
EffectType wall_effect();
EffectType run_in();
EffectType hard_layer();
EffectType crust();
EffectType penetration_rate();
EffectType peak_shear();
EffectType pressure_dependent_K();
EffectType curved_failure_envelope();
EffectType shear_rate();
EffectType interface_friction();
EffectType side_friction();
EffectType skew();
EffectType periodic_failure();
EffectType grousers();
EffectType bulldozing();
EffectType bed_drift();
EffectType undulation();
EffectType eccentricity();
EffectType slope();
EffectType crosstalk();
EffectType drawbar_bias();
EffectType torque_bias();
EffectType drive_friction();
EffectType sensor_gain();
EffectType sensor_drift();
EffectType sensor_lag();
EffectType sinkage_datum();
EffectType carriage_resonance();
EffectType node_ripple();
EffectType undamped_bed();

const std::vector<EffectType>& all_effects() {
  static const std::vector<EffectType> list = {
      slip_offset(),
      guide_friction(),
      wheel_flexibility(),
      rear_contact(),
      unloading(),
      slip_sinkage(),
      multi_pass(),
      plate_scale(),
      gravity(),
      density_gradient(),
      wall_effect(),
      run_in(),
      hard_layer(),
      crust(),
      penetration_rate(),
      peak_shear(),
      pressure_dependent_K(),
      curved_failure_envelope(),
      shear_rate(),
      interface_friction(),
      side_friction(),
      skew(),
      periodic_failure(),
      grousers(),
      bulldozing(),
      bed_drift(),
      undulation(),
      eccentricity(),
      slope(),
      crosstalk(),
      drawbar_bias(),
      torque_bias(),
      drive_friction(),
      sensor_gain(),
      sensor_drift(),
      sensor_lag(),
      sinkage_datum(),
      carriage_resonance(),
      node_ripple(),
      undamped_bed(),
  };
  return list;
}

}  // namespace terrode::effects
