#include <fmt/format.h>

#include "scenario/section.h"

namespace terrode::scenario {
namespace {

using recording::SoilBelief;

// kc [N/m^(n+1)] and kphi [N/m^(n+2)] have units that hold the exponent n of the same soil.
Table<SoilBelief>::Key bekker_modulus_key(const std::string& name, double power, std::optional<double> SoilBelief::*member,
                                          Range range, const std::string& text) {
  const auto unit = [power](const SoilBelief& s) { return fmt::format("N/m^{:.12g}", s.n.value_or(1.0) + power); };
  return {name, false, quantity_schema("", range, text),
          [=](MapReader& map, SoilBelief& out) {
            if (const auto v = map.number(name, unit(out), range)) out.*member = *v;
          },
          [=](const SoilBelief& in) -> std::optional<Node> {
            if (!(in.*member)) return std::nullopt;
            return quantity_node(*(in.*member), unit(in));
          }};
}

Table<SoilBelief> bekker_table() {
  Table<SoilBelief> t;
  t.number("cohesion", "Pa", at_least(0), &SoilBelief::cohesion, "c of Mohr-Coulomb")
      .number("friction_angle", "rad", {0, 1.55, false, false}, &SoilBelief::friction_angle, "phi of Mohr-Coulomb")
      .number("shear_modulus", "m", above(0), &SoilBelief::shear_modulus, "K of Janosi and Hanamoto")
      .number("n", "-", {0, 5, true, false}, &SoilBelief::n, "exponent of pressure-sinkage")
      .number("k", "Pa", above(0), &SoilBelief::k, "k of sigma = k (z/plate_width)^n; with plate_width")
      .number("plate_width", "m", above(0), &SoilBelief::plate_width, "width of the plate that k refers to")
      .add(bekker_modulus_key("kc", 1.0, &SoilBelief::kc, any_number(), "Bekker's cohesive modulus [N/m^(n+1)]; with kphi"))
      .add(bekker_modulus_key("kphi", 2.0, &SoilBelief::kphi, any_number(), "Bekker's frictional modulus [N/m^(n+2)]; with kc"));
  return t;
}

Table<SoilBelief> contact_table() {
  Table<SoilBelief> t;
  t.number("a0", "-", from_to(0, 2), &SoilBelief::a0, "of theta_m = (a0 + a1 s) theta_f; absent: 0.18")
      .number("a1", "-", from_to(-3, 3), &SoilBelief::a1, "of theta_m = (a0 + a1 s) theta_f; absent: 0.32")
      .number("theta_r", "rad", from_to(-1.57, 0), &SoilBelief::theta_r, "exit angle, 0 or negative; absent: 0");
  return t;
}

}  // namespace

Table<SoilBelief> soil_table() {
  Table<SoilBelief> t;
  t.text("name", &SoilBelief::name, "what the soil is called")
      .number("bulk_density", "kg/m^3", above(0), &SoilBelief::bulk_density, "absent: 1600 kg/m^3")
      .group("bekker", bekker_table(), "Bekker, Mohr-Coulomb and Janosi parameters")
      .group("contact", contact_table(), "where the stress peaks and ends under a wheel");
  return t;
}

Problems check_soil(const SoilBelief& s) {
  Problems out;
  const auto need = [&out](bool there, const char* key) {
    if (!there) out.push_back({{}, 0, 0, key, "is missing", {}});
  };
  need(s.cohesion.has_value(), "bekker.cohesion");
  need(s.friction_angle.has_value(), "bekker.friction_angle");
  need(s.shear_modulus.has_value(), "bekker.shear_modulus");
  need(s.n.has_value(), "bekker.n");
  if (s.kc || s.kphi) {
    need(s.kc.has_value(), "bekker.kc");
    need(s.kphi.has_value(), "bekker.kphi");
    if (s.k) out.push_back({{}, 0, 0, "bekker.k", "is given beside kc and kphi", "either k with plate_width, or kc with kphi"});
  } else {
    need(s.k.has_value(), "bekker.k");
    need(s.plate_width.has_value(), "bekker.plate_width");
  }
  return out;
}

Section soil_section() {
  Section section;
  section.name = "soil";
  section.required = true;
  section.read = [](const Node& node, const std::string& key, Source& source, Scenario& out) {
    inline_or_file(node, key, source, [&out](const Node& n, const std::string& k, Source& s) {
      MapReader map(n, k, s);
      const std::size_t before = s.problems.size();
      soil_table().read(map, out.soil);
      if (s.problems.size() > before) return;
      Problems missing = check_soil(out.soil);
      locate(missing, n, s.file, "");
      for (Problem& p : missing) {
        p.key = k.empty() ? p.key : k + "." + p.key;
        s.problems.push_back(p);
      }
    });
  };
  section.write = [](const Scenario& in) { return soil_table().write(in.soil); };
  section.schema = [] {
    Json schema = soil_table().schema();
    return Json{{"description", "the soil, or the path of a file that holds it"},
                {"anyOf", Json::array({Json{{"type", "string"}}, schema})}};
  };
  return section;
}

}  // namespace terrode::scenario
