#include "scenario/section.h"
#include "vehicle/rig.h"

namespace terrode::scenario {
namespace {

Table<RigSpec> rig_table() {
  using bekker::SlipConvention;
  const std::vector<std::string> conventions = {bekker::slip_convention_text(SlipConvention::wong_reece),
                                                bekker::slip_convention_text(SlipConvention::driving_braking),
                                                bekker::slip_convention_text(SlipConvention::printed)};
  Table<RigSpec> t;
  t.number("normal_load", "N", above(0), &RigSpec::normal_load, "vertical load on the soil, the wheel's weight included")
      .number("angular_velocity", "rad/s", above(0), &RigSpec::angular_velocity, "of the wheel")
      .choice("slip_convention", conventions, &RigSpec::slip_convention, "what every slip of this file means")
      .choice("mode", {"imposed_slip", "imposed_pull", "pull_ramp", "towed"}, &RigSpec::mode, "what the rig imposes")
      .number("slip", "-", any_number(), &RigSpec::slip, "of a single run")
      .number("pull", "N", any_number(), &RigSpec::pull, "resisting pull of mode imposed_pull; where pull_ramp begins")
      .number("final_pull", "N", any_number(), &RigSpec::final_pull, "where pull_ramp ends")
      .number("travel", "m", above(0), &RigSpec::travel, "of the carriage in a run")
      .number("ramp", "s", above(0), &RigSpec::ramp, "time in which the speeds rise")
      .number("time_step", "s", from_to(multibody::kShortestStep, 0.1), &RigSpec::time_step, "of the multibody simulation")
      .number("sample_interval", "s", above(0), &RigSpec::sample_interval, "of the time series")
      .number("gravity", "m/s^2", {0, multibody::kStrongestGravity, true, false}, &RigSpec::gravity, "of the place")
      .number("slope", "rad", between(-1, 1), &RigSpec::slope, "of the rail, positive where it climbs")
      .number("carriage_mass", "kg", above(0), &RigSpec::carriage_mass, "felt where the carriage is free")
      .number("lifted_mass", "kg", above(0), &RigSpec::lifted_mass, "that moves up and down; absent: the load as dead weight");
  return t;
}

Table<TerrainSpec> terrain_table() {
  Table<TerrainSpec> t;
  t.number("node_spacing", "m", {0, 1, true, false}, &TerrainSpec::node_spacing, "distance between nodes")
      .choice("distribution", {"wong_reece", "sinkage"}, &TerrainSpec::distribution, "what sets the pressure under a rolling wheel")
      .choice("unloading", {"rigid_plastic", "elastic_plastic", "elastic"}, &TerrainSpec::unloading, "what is left of it when the wheel rises")
      .choice("area", {"arc", "projected"}, &TerrainSpec::area, "of the wheel that a node carries")
      .choice("shear_history", {"rim", "ground", "closed_form"}, &TerrainSpec::shear_history, "where shear displacement is kept")
      .choice("skid_shear", {"as_printed", "along_displacement"}, &TerrainSpec::skid_shear, "sign of shear at negative slip, of closed_form and steady")
      .number("springback", "m", above(0), &TerrainSpec::springback, "rise over which a node of rigid_plastic lets go")
      .number("unloading_k0", "Pa/m", at_least(0), &TerrainSpec::unloading_k0, "k0 of elastic_plastic")
      .number("unloading_au", "Pa/m^2", at_least(0), &TerrainSpec::unloading_au, "A_u of elastic_plastic")
      .number("damping", "Pa s/m", at_least(0), &TerrainSpec::damping, "dashpot along the surface normal")
      .number("damping_time", "s", at_least(0), &TerrainSpec::damping_time, "a dashpot of this times the ground's stiffness there")
      .choice("side_wall", {"none", "hegedus"}, &TerrainSpec::side_wall, "soil that the side of a sunk wheel pushes")
      .number("heap_fraction", "-", from_to(0, 1), &TerrainSpec::heap_fraction, "of the soil pushed down that is heaped around the contact")
      .number("repose_angle", "rad", {0, 1.55, false, false}, &TerrainSpec::repose_angle, "slope to which heaps and rut walls fall; 0: they stand");
  return t;
}

}  // namespace

Section rig_section() {
  Section section;
  section.name = "rig";
  section.required = true;
  section.read = [](const Node& node, const std::string& key, Source& source, Scenario& out) {
    MapReader map(node, key, source);
    rig_table().read(map, out.rig);
    if (!map.has("angular_velocity") && node.kind == Node::Kind::map)
      source.note(node, key + ".angular_velocity", "is absent: 0.3 rad/s assumed");
  };
  section.write = [](const Scenario& in) { return rig_table().write(in.rig); };
  section.schema = [] { return rig_table().schema(); };
  return section;
}

Section terrain_section() {
  Section section;
  section.name = "terrain";
  section.read = [](const Node& node, const std::string& key, Source& source, Scenario& out) {
    MapReader map(node, key, source);
    terrain_table().read(map, out.terrain);
  };
  section.write = [](const Scenario& in) { return terrain_table().write(in.terrain); };
  section.schema = [] { return terrain_table().schema(); };
  return section;
}

}  // namespace terrode::scenario
