#include <fmt/format.h>

#include <algorithm>

#include "liggghts/law.h"
#include "scenario/section.h"

namespace terrode::scenario {
namespace {

using P = ParticleSpec;

Table<P> particles_table() {
  Table<P> t;
  // Grains and bed.
  t.number("smallest", "m", above(0), &P::smallest, "diameter; absent: 0.077 of the wheel's radius")
      .number("largest", "m", above(0), &P::largest, "diameter; absent: 0.108 of the wheel's radius")
      .choice("distribution", {"uniform", "linear"}, &P::distribution, "density of diameters: constant or proportional to the diameter")
      .choice("by", {"number", "mass"}, &P::by, "what the distribution is a share of")
      .number("prism", "m", above(0), &P::prism, "side of the settled prism that is repeated; absent: 0.46 radii")
      .number("prism_across", "m", above(0), &P::prism_across, "its side across the travel; absent: as along it")
      .number("depth", "m", above(0), &P::depth, "of the bed; absent: 0.77 radii")
      .choice("floor", {"smooth", "rough"}, &P::floor, "under the bed; smooth: without friction, as the paper's; rough: as grain on grain")
      .number("width", "m", above(0), &P::width, "of the bed, rounded up to whole prisms; absent: the wheel's and 0.6 radii, two prisms or more")
      .choice("bed", {"moving", "full"}, &P::bed, "moving: laid ahead of the wheel, frozen behind it; full: all at once, its border fixed")
      .number("length", "m", above(0), &P::length, "of a full bed along the travel")
      .number("behind", "m", above(0), &P::behind, "of a full bed behind the place where the wheel is set down")
      .number("border", "m", at_least(0), &P::border, "of a full bed, in which grains are fixed")
      .number("window_ahead", "m", above(0), &P::window_ahead, "beyond the axle that moves, never less than what is sunk; absent: 1.6 radii")
      .number("window_behind", "m", above(0), &P::window_behind, "behind the axle that moves, never less than what is sunk; absent: 1.3 radii");
  // Wheel surface.
  t.choice("wheel_surface", {"shape", "spheres"}, &P::wheel_surface, "the wheel in closed form, or a shell of overlapping spheres")
      .number("sphere_diameter", "m", above(0), &P::sphere_diameter, "of a shell's spheres")
      .number("sphere_spacing", "-", {0, 1.5, true, true}, &P::sphere_spacing, "of a shell's spheres, in their radius");
  // Time.
  t.number("time_step", "s", above(0), &P::time_step, "of the particles; absent: from the Rayleigh time")
      .number("time_step_fraction", "-", {0, 0.3, true, true}, &P::time_step_fraction, "of the smallest Rayleigh time");
  // Law.
  t.number("young_modulus", "Pa", above(0), &P::young_modulus, "of the grains")
      .number("poisson_ratio", "-", {0, 0.5, false, true}, &P::poisson_ratio, "of the grains")
      .number("restitution", "-", {0, 1, true, false}, &P::restitution, "of grain on grain")
      .number("friction", "-", at_least(0), &P::friction, "of grain on grain and on the wheel")
      .choice("tangential", {"none", "mindlin", "mindlin_capped_sum"}, &P::tangential, "part of the law along the contact")
      .choice("rolling", {"none", "cdt", "epsd", "epsd2", "epsd_capped_sum", "epsd_unprojected", "epsd2_unprojected"}, &P::rolling,
              "part of the law against rolling")
      .number("rolling_friction", "-", at_least(0), &P::rolling_friction, "mu_r")
      .number("rolling_rate", "s^2/m^2", at_least(0), &P::rolling_rate, "mu_r = min(rolling_rate v_t^2, 1); 0: constant mu_r")
      .number("wheel_friction", "-", at_least(0), &P::wheel_friction, "of grain on wheel; absent: as grain on grain")
      .number("wheel_rolling_friction", "-", at_least(0), &P::wheel_rolling_friction, "of grain on wheel; absent: as grain on grain")
      .number("settling_friction", "-", at_least(0), &P::settling_friction,
              "of grain on grain while the bed settles: low for a dense bed; absent: friction")
      .number("settling_rolling_friction", "-", at_least(0), &P::settling_rolling_friction,
              "mu_r while the bed settles; absent: rolling_friction");
  // What another engine leaves out of it.
  const std::vector<std::string>& known = liggghts::approximations();
  const Json words = {{"type", "array"},
                      {"description", "departures from this law that the method mpi may make; it refuses those that are not named"},
                      {"items", {{"enum", known}}}};
  t.add({"approximate", false, words,
         [&known](MapReader& map, P& out) {
           for (const auto& [key, item] : map.items("approximate")) {
             if (item->kind == Node::Kind::scalar && std::find(known.begin(), known.end(), item->text) != known.end()) {
               out.approximate.push_back(item->text);
               continue;
             }
             std::string all;
             for (const std::string& name : known) all += (all.empty() ? "" : ", ") + name;
             map.source().problem(*item, key, item->kind == Node::Kind::scalar ? "is '" + item->text + "'" : "is no word", "one of " + all);
           }
         },
         [](const P& in) -> std::optional<Node> {
           if (in.approximate.empty()) return std::nullopt;
           Node list = Node::sequence();
           for (const std::string& name : in.approximate) list.items.push_back(Node::scalar(name));
           return list;
         }});
  return t;
}

}  // namespace

Section particles_section() {
  Section section;
  section.name = "particles";
  section.read = [](const Node& node, const std::string& key, Source& source, Scenario& out) {
    MapReader map(node, key, source);
    particles_table().read(map, out.particles);
    if (out.particles.smallest && out.particles.largest && *out.particles.smallest > *out.particles.largest)
      source.problem(node, key + ".smallest", "is above largest", "smallest at most largest");
  };
  section.write = [](const Scenario& in) { return particles_table().write(in.particles); };
  section.schema = [] { return particles_table().schema(); };
  return section;
}

}  // namespace terrode::scenario
