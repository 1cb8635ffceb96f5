#include "scenario/scenario.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>
#include <tuple>

#include "core/units.h"
#include "scenario/recording_file.h"
#include "scenario/section.h"
#include "wheel/convex.h"

namespace terrode::scenario {
namespace {

namespace fs = std::filesystem;

// One line a section, in the order in which they are read and written.
std::vector<Section> sections() {
  return {
      wheel_section(),
      soil_section(),
      rig_section(),
      terrain_section(),
      particles_section(),
      effects_section(),
      laws_section(),
      surface_section(),
      soil_map_section(),
      soil_layers_section(),
      sweep_section(),
      measured_section(),
  };
}

void read_methods(MapReader& map, Scenario& out) {
  const bool one = map.has("method"), many = map.has("methods");
  if (one && many) map.source().problem(map.node(), map.key("method"), "stands beside methods", "one of the two");
  if (one)
    if (const auto m = map.choice("method", method_names())) out.methods = {*m};
  for (const auto& [key, item] : map.items("methods"))
    if (const auto m = read_choice(*item, key, method_names(), map.source())) out.methods.push_back(*m);
}

// The convention is known only when the rig has been read, so slips of the measured points are turned afterwards.
void convert_measured_slips(const Node& root, Source& source, Scenario& out) {
  if (!out.measured || out.from_recording || !out.measured_file.empty()) return;
  const auto convention = out.slip_convention();
  for (recording::Run& run : out.measured->runs) {
    try {
      run.condition.slip = bekker::to_wong_reece(run.condition.slip, convention);
    } catch (const InputError& e) {
      const std::string key = run.id + ".slip";
      const Node* at = root.at(key);
      for (const Problem& p : e.problems()) source.problem(at ? *at : root, key, p.message, p.expected);
    }
  }
}

void check_slips(const Node& root, Source& source, const Scenario& in) {
  const auto convention = in.slip_convention();
  const auto check = [&](double slip, const std::string& key) {
    try {
      bekker::to_wong_reece(slip, convention);
    } catch (const InputError& e) {
      const Node* at = root.at(key);
      for (const Problem& p : e.problems()) source.problem(at ? *at : root, key, p.message, p.expected);
    }
  };
  for (std::size_t i = 0; i < in.slips.size(); ++i)
    check(in.slips[i], root.at("sweep.slips[0]") ? fmt::format("sweep.slips[{}]", i) : "sweep.slips");
  for (std::size_t i = 0; i < in.conditions.size(); ++i)
    check(in.conditions[i].slip, fmt::format("sweep.conditions[{}].slip", i));
  check(in.rig.slip, "rig.slip");
}

Scenario read_root(const Node& root, Source& source) {
  Scenario out;
  out.file = source.file;
  MapReader map(root, "", source);
  map.know("format");
  if (const auto title = map.text("title")) out.title = *title;
  if (const auto seed = map.integer("seed", 0, 2147483647)) out.seed = static_cast<int>(*seed);
  read_methods(map, out);
  for (const Section& section : sections()) {
    if (section.required) map.need(section.name);
    if (const Node* node = section.required || map.has(section.name) ? root.find(section.name) : nullptr) {
      if (node->kind == Node::Kind::null) {
        if (!section.required) map.find(section.name);
        continue;
      }
      section.read(*node, section.name, source, out);
    }
  }
  map.finish();
  if (source.problems.empty()) {
    check_slips(root, source, out);
    convert_measured_slips(root, source, out);
  }
  out.notes = source.notes;
  return out;
}

}  // namespace

const std::vector<std::string>& method_names() {
  static const std::vector<std::string> names = {"steady", "node-spring", "dem", "mpi"};
  return names;
}

const std::vector<double>& default_slips() {
  static const std::vector<double> slips = {-0.7, -0.5, -0.3, -0.1, 0.0, 0.1, 0.3, 0.5, 0.7};
  return slips;
}

void inline_or_file(const Node& node, const std::string& key, Source& source,
                    const std::function<void(const Node&, const std::string&, Source&)>& read) {
  if (node.kind != Node::Kind::scalar) return read(node, key, source);
  const std::size_t before = source.problems.size();
  const std::string path = named_path(node.text, node, key, source);
  if (source.problems.size() > before) return;
  try {
    const Node root = read_yaml(path);
    Source below{path, {}, {}};
    read(root, "", below);
    source.problems.insert(source.problems.end(), below.problems.begin(), below.problems.end());
    source.notes.insert(source.notes.end(), below.notes.begin(), below.notes.end());
  } catch (const InputError& e) {
    if (e.problems().size() == 1 && e.problems().front().line == 0) {
      source.problem(node, key, fmt::format("names the file '{}', which {}", path, e.problems().front().message));
    } else {
      source.problems.insert(source.problems.end(), e.problems().begin(), e.problems().end());
    }
  }
}

Scenario parse_scenario(const std::string& text, const std::string& file) {
  const Node root = parse_yaml(text, file);
  Source source{file, {}, {}};
  Scenario out = read_root(root, source);
  throw_if_any(source.problems);
  out.text = text;
  return out;
}

Scenario load_scenario(const std::string& path, int threads) {
  if (is_recording(path)) {
    Scenario out = scenario_of(load_recording(path, threads));
    out.file = fs::is_directory(path) ? (fs::path(path) / "recording.yaml").string() : path;
    out.text = read_text_file(out.file, ReadLimits{}.bytes);
    return out;
  }
  return parse_scenario(read_text_file(path, ReadLimits{}.bytes), path);
}

Scenario scenario_of(const recording::Recording& r) {
  Scenario out;
  out.file = (fs::path(r.folder) / "recording.yaml").string();
  out.title = r.title;
  out.from_recording = true;
  out.wheel.radius = r.wheel.radius;
  out.wheel.width = r.wheel.width;
  out.wheel.mass = r.wheel.mass;
  out.wheel.surface = r.wheel.surface;
  out.wheel.grouser_count = r.wheel.grouser_count.value_or(0);
  out.wheel.grouser_height = r.wheel.grouser_height.value_or(0.0);
  out.soil = r.soil;
  const auto convention = bekker::parse_slip_convention(r.slip_convention).value_or(bekker::SlipConvention::wong_reece);
  out.rig.slip_convention = bekker::slip_convention_text(convention);
  for (const recording::Run& run : r.runs) {
    const recording::Condition& c = run.condition;
    SweepCondition condition;
    condition.slip = bekker::from_wong_reece(c.slip, convention);
    condition.normal_load = c.normal_load;
    condition.angular_velocity = c.angular_velocity;
    // A locked wheel is dragged at the speed that its rim would have.
    if (std::isinf(c.slip) && c.forward_velocity) condition.angular_velocity = *c.forward_velocity / r.wheel.radius;
    condition.pass = c.pass;
    if (!out.rig.normal_load && c.normal_load) out.rig.normal_load = c.normal_load;
    const auto same = [&](const SweepCondition& o) {
      return o.slip == condition.slip && o.normal_load == condition.normal_load &&
             o.angular_velocity == condition.angular_velocity && o.pass == condition.pass;
    };
    if (std::none_of(out.conditions.begin(), out.conditions.end(), same)) out.conditions.push_back(condition);
  }
  if (!out.conditions.empty()) {
    out.rig.slip = out.conditions.front().slip;
    out.rig.angular_velocity = out.conditions.front().angular_velocity.value_or(out.rig.angular_velocity);
  }
  out.measured = r;
  out.notes = r.remarks;
  return out;
}

std::string to_yaml(const Scenario& in) {
  Node root = Node::map();
  if (!in.title.empty()) root.set("title", Node::scalar(in.title));
  if (!in.methods.empty()) {
    Node& list = root.set("methods", Node::sequence());
    for (const std::string& m : in.methods) list.items.push_back(Node::scalar(m));
  }
  root.set("seed", Node::scalar(std::to_string(in.seed)));
  for (const Section& section : sections())
    if (auto value = section.write(in)) root.set(section.name, std::move(*value));
  return to_yaml(root);
}

std::string scenario_schema() {
  Json properties = Json::object(), required = Json::array();
  properties["title"] = {{"type", "string"}};
  properties["format"] = {{"type", "string"}};
  properties["method"] = {{"enum", method_names()}, {"description", "one method, in place of methods"}};
  properties["methods"] = {{"type", "array"}, {"items", {{"enum", method_names()}}}};
  properties["seed"] = {{"type", "integer"}, {"minimum", 0}};
  for (const Section& section : sections()) {
    properties[section.name] = section.schema();
    if (section.required) required.push_back(section.name);
  }
  const Json schema = {{"$schema", "https://json-schema.org/draft/2020-12/schema"},
                       {"title", "Terrode scenario"},
                       {"type", "object"},
                       {"additionalProperties", false},
                       {"properties", properties},
                       {"required", required}};
  return schema.dump(2) + "\n";
}

bekker::SlipConvention Scenario::slip_convention() const {
  const auto convention = bekker::parse_slip_convention(rig.slip_convention);
  if (!convention) throw InputError({file, 0, 0, "rig.slip_convention", fmt::format("is '{}'", rig.slip_convention), "a known convention"});
  return *convention;
}

std::vector<OperatingPoint> Scenario::operating_points() const {
  if (conditions.empty()) return operating_points(slips.empty() ? default_slips() : slips);
  std::vector<OperatingPoint> out;
  for (const SweepCondition& c : conditions) {
    const auto load = c.normal_load ? c.normal_load : rig.normal_load;
    if (!load) throw InputError({file, 0, 0, "rig.normal_load", "is missing", {}});
    out.push_back({bekker::to_wong_reece(c.slip, slip_convention()), c.slip, *load,
                   c.angular_velocity.value_or(rig.angular_velocity), c.pass});
  }
  return out;
}

std::vector<OperatingPoint> Scenario::operating_points(const std::vector<double>& asked) const {
  std::vector<std::tuple<double, double, int>> settings;
  for (const SweepCondition& c : conditions) {
    const auto load = c.normal_load ? c.normal_load : rig.normal_load;
    if (!load) throw InputError({file, 0, 0, "rig.normal_load", "is missing", {}});
    const std::tuple setting(*load, c.angular_velocity.value_or(rig.angular_velocity), c.pass);
    if (std::find(settings.begin(), settings.end(), setting) == settings.end()) settings.push_back(setting);
  }
  if (conditions.empty()) {
    if (!rig.normal_load) throw InputError({file, 0, 0, "rig.normal_load", "is missing", {}});
    settings.emplace_back(*rig.normal_load, rig.angular_velocity, 1);
  }
  std::vector<OperatingPoint> out;
  for (const auto& [load, speed, pass] : settings)
    for (const double s : asked) out.push_back({bekker::to_wong_reece(s, slip_convention()), s, load, speed, pass});
  return out;
}

bekker::Soil Scenario::bekker_soil(const recording::SoilBelief& belief, const std::string& where) const {
  Problems missing = check_soil(belief);
  for (Problem& p : missing) {
    p.file = file;
    p.key = where + p.key;
  }
  throw_if_any(missing);
  bekker::Soil out;
  out.cohesion = *belief.cohesion;
  out.friction_angle = *belief.friction_angle;
  out.shear_modulus = *belief.shear_modulus;
  out.n = *belief.n;
  if (belief.kc) {
    out.k = bekker::bekker_modulus(*belief.kc, *belief.kphi, wheel.width);
    out.plate_width = 1.0;
  } else {
    out.k = *belief.k;
    out.plate_width = *belief.plate_width;
  }
  out.bulk_density = belief.bulk_density.value_or(1600.0);
  out.gravity = rig.gravity;
  Problems wrong = out.validate();
  for (Problem& p : wrong) {
    p.file = file;
    p.key = where + "bekker." + p.key;
  }
  throw_if_any(wrong);
  return out;
}

bekker::ContactAngles Scenario::contact_angles() const {
  bekker::ContactAngles out;
  out.a0 = soil.a0.value_or(out.a0);
  out.a1 = soil.a1.value_or(out.a1);
  out.theta_r = soil.theta_r.value_or(out.theta_r);
  Problems wrong = out.validate();
  for (Problem& p : wrong) {
    p.file = file;
    p.key = "soil.contact." + p.key;
  }
  throw_if_any(wrong);
  return out;
}

bekker::WheelSize Scenario::wheel_size() const { return {wheel.radius, wheel.width}; }

wheel::Grousers grousers_of(const WheelSpec& wheel) {
  using terrode::wheel::GrouserShape;
  terrode::wheel::Grousers out;
  if (wheel.grouser_count == 0) return out;
  out.count = wheel.grouser_count;
  out.height = wheel.grouser_height;
  out.thickness = wheel.grouser_thickness;
  out.tip_thickness = wheel.grouser_tip_thickness;
  out.phase = wheel.grouser_phase;
  out.shape = wheel.grouser_shape == "tapered"      ? GrouserShape::tapered
              : wheel.grouser_shape == "triangular" ? GrouserShape::triangular
                                                    : GrouserShape::straight;
  return out;
}

WheelSpec wheel_spec_of(const wheel::Grousers& grousers) {
  using terrode::wheel::GrouserShape;
  WheelSpec out;
  out.grouser_count = grousers.count;
  out.grouser_height = grousers.height;
  out.grouser_thickness = grousers.thickness;
  out.grouser_tip_thickness = grousers.tip_thickness;
  out.grouser_phase = grousers.phase;
  out.grouser_shape = grousers.shape == GrouserShape::tapered      ? "tapered"
                      : grousers.shape == GrouserShape::triangular ? "triangular"
                                                                   : "straight";
  return out;
}

wheel::WheelShape Scenario::wheel_shape() const {
  terrode::wheel::WheelShape out;
  out.radius = wheel.radius;
  out.width = wheel.width;
  out.crown_radius = wheel.crown_radius;
  out.grousers = grousers_of(wheel);
  Problems wrong = out.validate();
  for (Problem& p : wrong) {
    p.file = file;
    p.key = "wheel." + p.key;
  }
  throw_if_any(wrong);
  return out;
}

std::shared_ptr<const wheel::Body> Scenario::wheel_body() const {
  const terrode::wheel::WheelShape shape = wheel_shape();
  if (wheel.pieces.empty()) return std::make_shared<terrode::wheel::Wheel>(shape);
  return std::make_shared<terrode::wheel::ConvexPieces>(terrode::wheel::around_axle(wheel.pieces, wheel.piece_count),
                                                        terrode::wheel::Rolling{shape.radius, shape.width, 0.0});
}

}  // namespace terrode::scenario
