#include "scenario/ground.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "bekker/pressure_laws.h"
#include "bekker/shear_laws.h"
#include "scenario/section.h"
#include "terrain/surfaces.h"

namespace terrode::scenario {

namespace {

using terrain::Surface;

class Sum final : public Surface {
 public:
  explicit Sum(std::vector<std::shared_ptr<const Surface>> parts) : parts_(std::move(parts)) {}
  double height(double x, double y) const override {
    double z = 0.0;
    for (const auto& s : parts_) z += s->height(x, y);
    return z;
  }
  Eigen::Vector2d gradient(double x, double y) const override {
    Eigen::Vector2d g = Eigen::Vector2d::Zero();
    for (const auto& s : parts_) g += s->gradient(x, y);
    return g;
  }

 private:
  std::vector<std::shared_ptr<const Surface>> parts_;
};

// Rises from 0 to `height` over `run` where x cos(azimuth) + y sin(azimuth) passes `at`.
class Step final : public Surface {
 public:
  Step(double at, double height, double run, double azimuth)
      : at_(at), height_(height), run_(run), c_(std::cos(azimuth)), s_(std::sin(azimuth)) {}
  double height(double x, double y) const override { return height_ * std::clamp(share(x, y), 0.0, 1.0); }
  Eigen::Vector2d gradient(double x, double y) const override {
    const double u = share(x, y);
    return u > 0.0 && u < 1.0 ? Eigen::Vector2d(height_ / run_ * c_, height_ / run_ * s_) : Eigen::Vector2d::Zero();
  }

 private:
  double share(double x, double y) const { return (x * c_ + y * s_ - at_) / run_; }
  double at_, height_, run_, c_, s_;
};

// The bed as effects shape it.
class Bed final : public Surface {
 public:
  explicit Bed(effects::EffectSet effects) : effects_(std::move(effects)) {}
  double height(double x, double) const override { return effects_.bed_height(x); }
  Eigen::Vector2d gradient(double x, double) const override {
    constexpr double step = 1e-5;  // m: short against any wave of a bed, long against rounding
    return {(effects_.bed_height(x + step) - effects_.bed_height(x - step)) / (2.0 * step), 0.0};
  }

 private:
  effects::EffectSet effects_;
};

// The keys of each kind of surface. `unit` is that of heights: m, or none where the height is a share.
const std::vector<std::string> kKinds = {"level", "slope", "step", "fractal", "png", "ascii"};

Table<SurfacePart> part_table(const std::string& kind, const std::string& unit) {
  using P = SurfacePart;
  Table<P> t;
  const auto azimuth = [&t] { t.number("azimuth", "rad", any_number(), &P::azimuth, "direction, from x to y"); };
  if (kind == "level") {
    t.number("height", unit, any_number(), &P::height, "of the ground");
  } else if (kind == "slope") {
    if (unit.empty())
      t.number("at", "m", any_number(), &P::at, "distance along azimuth at which the share is 0")
          .number("run", "m", above(0), &P::run, "in which it rises by 1");
    else
      t.number("angle", "rad", between(-1.2, 1.2), &P::angle, "of the climb towards azimuth");
    azimuth();
  } else if (kind == "step") {
    t.number("at", "m", any_number(), &P::at, "distance along azimuth at which it begins").required();
    t.number("height", unit, any_number(), &P::height, "by which it rises").required();
    t.number("run", "m", above(0), &P::run, "in which it rises");
    azimuth();
  } else if (kind == "fractal") {
    t.number("rms_height", unit, at_least(0), &P::rms_height, "of the ground about its mean")
        .number("hurst", "-", {0, 1, true, false}, &P::hurst, "0 rough to 1 smooth")
        .number("longest", "m", above(0), &P::longest, "wavelength")
        .number("shortest", "m", above(0), &P::shortest, "wavelength")
        .integer("waves", 1, 10000, &P::waves, "that are summed")
        .integer("seed", 0, 2147483647, &P::seed, "of directions and phases");
  } else if (kind == "png") {
    t.text("file", &P::file, "grey picture of 8 or 16 bits").required();
    t.number("cell", "m", above(0), &P::cell, "width of a pixel").required();
    t.number("white", unit, any_number(), &P::white, "height of white").required();
    t.number("black", unit, any_number(), &P::black, "height of black")
        .number("x0", "m", any_number(), &P::x0, "of the lower left pixel")
        .number("y0", "m", any_number(), &P::y0, "of the lower left pixel");
  } else {
    t.text("file", &P::file, "ESRI ASCII grid").required();
  }
  return t;
}

// A share that rises from 0 along a line: a slope without dimension.
class Rise final : public Surface {
 public:
  explicit Rise(const SurfacePart& p) : at_(p.at), run_(p.run), c_(std::cos(p.azimuth)), s_(std::sin(p.azimuth)) {}
  double height(double x, double y) const override { return (x * c_ + y * s_ - at_) / run_; }
  Eigen::Vector2d gradient(double, double) const override { return {c_ / run_, s_ / run_}; }

 private:
  double at_, run_, c_, s_;
};

std::shared_ptr<const Surface> make_part(const SurfacePart& p, bool share) {
  if (p.kind == "slope") {
    if (share) return std::make_shared<Rise>(p);
    return std::make_shared<terrain::SlopeSurface>(p.angle, p.azimuth);
  }
  if (p.kind == "step") return std::make_shared<Step>(p.at, p.height, p.run, p.azimuth);
  if (p.kind == "fractal")
    return std::make_shared<terrain::FractalSurface>(
        terrain::FractalParams{p.rms_height, p.hurst, p.longest, p.shortest, p.waves, static_cast<std::uint64_t>(p.seed)});
  if (p.kind == "png")
    return std::make_shared<terrain::GridSurface>(terrain::read_png_heights(p.file, p.cell, p.black, p.white, p.x0, p.y0));
  if (p.kind == "ascii") return std::make_shared<terrain::GridSurface>(terrain::read_ascii_heights(p.file));
  return std::make_shared<terrain::LevelSurface>(p.height);
}

std::shared_ptr<const Surface> sum_of(const std::vector<SurfacePart>& parts, bool share) {
  std::vector<std::shared_ptr<const Surface>> made;
  for (const SurfacePart& p : parts) made.push_back(make_part(p, share));
  if (made.size() == 1) return made.front();
  return std::make_shared<Sum>(std::move(made));
}

// One part or a list of them, each tried, so that what is wrong with a file is said at its place.
std::vector<SurfacePart> read_parts(const Node& node, const std::string& key, Source& source, bool share) {
  std::vector<SurfacePart> out;
  const auto read_part = [&](const Node& n, const std::string& k) {
    MapReader map(n, k, source);
    const std::size_t before = source.problems.size();
    SurfacePart part;
    set_if(part.kind, map.choice("kind", kKinds));
    part_table(part.kind, share ? "" : "m").read(map, part);
    if (source.problems.size() > before) return;
    if (!part.file.empty()) {
      part.file = named_path(part.file, *map.find("file"), map.key("file"), source);
      if (source.problems.size() > before) return;
      part.file = std::filesystem::absolute(part.file).lexically_normal().string();
    }
    try {
      make_part(part, share);
      out.push_back(std::move(part));
    } catch (const InputError& e) {
      for (const Problem& p : e.problems()) source.problem(n, map.key(p.key.empty() ? "file" : p.key), p.message, p.expected);
    }
  };
  if (node.kind != Node::Kind::sequence) read_part(node, key);
  for (std::size_t i = 0; i < node.items.size(); ++i) read_part(node.items[i], fmt::format("{}[{}]", key, i));
  return out;
}

Node write_parts(const std::vector<SurfacePart>& parts, bool share) {
  Node list = Node::sequence();
  for (const SurfacePart& p : parts) {
    Node one = Node::map();
    one.set("kind", Node::scalar(p.kind));
    for (Node::Entry& e : part_table(p.kind, share ? "" : "m").write(p).entries) one.set(e.key, std::move(e.value));
    list.items.push_back(std::move(one));
  }
  return list;
}

Json parts_schema(const std::string& unit, const std::string& text) {
  Json kinds = Json::array();
  for (const std::string& kind : kKinds) {
    Json one = part_table(kind, unit).schema();
    const Json keys = one["properties"];
    Json properties = {{"kind", {{"const", kind}}}};
    for (const auto& [name, value] : keys.items()) properties[name] = value;
    one["properties"] = properties;
    kinds.push_back(one);
  }
  Json whole = kinds;
  whole.push_back({{"type", "array"}, {"items", {{"anyOf", kinds}}}});
  return {{"description", text}, {"anyOf", whole}};
}

// A soil that differs from the scenario's in what it says.
void read_other_soil(const Node& node, const std::string& key, Source& source, recording::SoilBelief& soil) {
  inline_or_file(node, key, source, [&](const Node& n, const std::string& k, Source& s) {
    MapReader map(n, k, s);
    // k stands in one form alone: of the two, what this soil gives.
    if (n.at("bekker.k") != nullptr) soil.kc = soil.kphi = std::nullopt;
    if (n.at("bekker.kphi") != nullptr) soil.k = soil.plate_width = std::nullopt;
    soil_table().read(map, soil);
  });
}

void check_other_soil(const Scenario& s, const recording::SoilBelief& soil, const Node& node, const std::string& key, Source& source) {
  try {
    s.bekker_soil(soil, key + ".soil.");
  } catch (const InputError& e) {
    for (const Problem& p : e.problems()) source.problem(node, p.key, p.message, p.expected);
  }
}

// ---- laws ----

struct Kind {
  std::string key, text;
  std::vector<std::string> names;
  std::string null_name;
};

const std::vector<Kind>& law_kinds() {
  static const std::vector<Kind> kinds = {
      {"pressure", "pressure against sinkage", bekker::pressure_law_names(), "power"},
      {"shear", "shear stress against displacement", bekker::shear_law_names(), "janosi"},
      {"failure", "shear strength; all but mohr_coulomb are effects of the same name",
       {"mohr_coulomb", "interface_friction", "curved_failure_envelope"}, "mohr_coulomb"},
      {"rate", "what speed does; effects of the same name", {"none", "penetration_rate", "shear_rate"}, "none"},
      {"damping", "dashpot along the surface normal; as terrain.damping and terrain.damping_time", {"none", "viscous", "rayleigh"}, "none"},
  };
  return kinds;
}

// The parameters of the laws that are not effects.
std::vector<bekker::LawParameter> parameters_of(const std::string& kind, const std::string& name) {
  if (kind == "pressure") return bekker::pressure_law_parameters(name);
  if (kind == "shear") return bekker::shear_law_parameters(name);
  if (name == "viscous") return {{"coefficient", "Pa s/m", "of the dashpot"}};
  if (name == "rayleigh") return {{"time", "s", "by which the ground's stiffness is multiplied"}};
  return {};
}

std::string unit_of(const bekker::LawParameter& p, const recording::SoilBelief& soil) {
  return std::isnan(p.power) ? p.unit : fmt::format("N/m^{:.12g}", soil.n.value_or(1.0) + p.power);
}

Range range_of(const bekker::LawParameter& p) { return {p.lower, p.upper, p.lower_open, p.upper_open}; }

// A law that is a name alone, or a map with a name and parameters.
struct Chosen {
  LawChoice law;
  std::optional<EffectSpec> effect;
};
std::optional<Chosen> read_law(MapReader& laws, const Kind& kind, const recording::SoilBelief& soil) {
  const Node* node = laws.find(kind.key);
  if (!node) return std::nullopt;
  Source& source = laws.source();
  const std::string key = laws.key(kind.key);
  Chosen out;
  static const Node nothing = Node::map();
  const bool bare = node->kind == Node::Kind::scalar;
  MapReader map(bare ? nothing : *node, key, source);
  const std::size_t before = source.problems.size();
  if (bare)
    set_if(out.law.name, read_choice(*node, key, kind.names, source));
  else if (map.need("name"))
    set_if(out.law.name, map.choice("name", kind.names));
  if (out.law.name.empty() || source.problems.size() > before) return std::nullopt;
  if (effects::find_effect(out.law.name)) {
    out.effect = read_effect(out.law.name, map);
  } else {
    for (const bekker::LawParameter& p : parameters_of(kind.key, out.law.name)) {
      auto value = map.number(p.name, unit_of(p, soil), range_of(p));
      if (!value && !map.has(p.name)) {
        if (p.name == "kc" && out.law.name == "bekker") value = soil.kc;
        if (p.name == "kphi" && out.law.name == "bekker") value = soil.kphi;
        if (!value) source.problem(*node, key + "." + p.name, "is missing", range_of(p).text(unit_of(p, soil)));
      }
      if (value) out.law.parameters[p.name] = *value;
    }
  }
  map.finish();
  if (source.problems.size() > before) return std::nullopt;
  return out;
}

void read_laws(const Node& node, const std::string& key, Source& source, Scenario& out) {
  MapReader map(node, key, source);
  for (const Kind& kind : law_kinds()) {
    const auto chosen = read_law(map, kind, out.soil);
    if (!chosen) continue;
    const Node& at = *map.find(kind.key);
    const LawChoice& law = chosen->law;
    if (chosen->effect) {
      const bool there = std::any_of(out.effects.begin(), out.effects.end(), [&](const EffectSpec& e) { return e.id == law.name; });
      if (there) source.problem(at, map.key(kind.key), "is '" + law.name + "', which stands under effects too", "one of the two");
      else out.effects.push_back(*chosen->effect);
    } else if (kind.key == "pressure") {
      out.pressure_law = law;
    } else if (kind.key == "shear") {
      out.shear_law = law;
    } else if (kind.key == "damping" && law.name != kind.null_name) {
      double& value = law.name == "viscous" ? out.terrain.damping : out.terrain.damping_time;
      if (value != 0.0) source.problem(at, map.key(kind.key), "stands beside the same of terrain", "one of the two");
      value = law.parameters.begin()->second;
    }
  }
  map.finish();
  // In the order in which they act, as if they stood under effects.
  const auto place = [](const EffectSpec& e) {
    const auto& all = effects::all_effects();
    return std::find_if(all.begin(), all.end(), [&](const effects::EffectType& t) { return t.info->id == e.id; }) - all.begin();
  };
  std::stable_sort(out.effects.begin(), out.effects.end(), [&](const EffectSpec& a, const EffectSpec& b) { return place(a) < place(b); });
}

std::optional<Node> write_laws(const Scenario& in) {
  Node out = Node::map();
  for (const auto& [kind, law] : {std::pair{&law_kinds()[0], &in.pressure_law}, {&law_kinds()[1], &in.shear_law}}) {
    if (law->name == kind->null_name) continue;
    Node& below = out.set(kind->key, Node::map());
    below.set("name", Node::scalar(law->name));
    for (const bekker::LawParameter& p : parameters_of(kind->key, law->name))
      if (const auto v = law->parameters.find(p.name); v != law->parameters.end())
        below.set(p.name, quantity_node(v->second, unit_of(p, in.soil)));
  }
  if (out.entries.empty()) return std::nullopt;
  return out;
}

Json laws_schema() {
  Json properties = Json::object();
  for (const Kind& kind : law_kinds()) {
    Json any = Json::array({Json{{"enum", kind.names}}});
    for (const std::string& name : kind.names) {
      Json own = {{"name", {{"const", name}}}}, needed = Json::array({"name"});
      if (effects::find_effect(name)) {
        const Json parameters = effect_parameters_schema(name);
        for (const auto& [p, schema] : parameters.items()) own[p] = schema;
      } else {
        for (const bekker::LawParameter& p : parameters_of(kind.key, name)) {
          own[p.name] = quantity_schema(std::isnan(p.power) ? p.unit : "", range_of(p), p.meaning);
          if (name != "bekker") needed.push_back(p.name);
        }
      }
      any.push_back({{"type", "object"}, {"additionalProperties", false}, {"properties", own}, {"required", needed}});
    }
    properties[kind.key] = {{"description", kind.text}, {"anyOf", any}};
  }
  return {{"type", "object"},
          {"description", "by which laws the ground answers: a name, or name and parameters"},
          {"additionalProperties", false},
          {"properties", properties}};
}

// What point_law() points to.
struct Laws {
  std::unique_ptr<bekker::PressureLaw> pressure;
  std::unique_ptr<bekker::ShearLaw> shear;
  std::vector<std::unique_ptr<bekker::StressModifier>> made;
  std::vector<const bekker::StressModifier*> modifiers;
};

std::shared_ptr<Laws> make_laws(const Scenario& s, GroundLaw& out) {
  auto laws = std::make_shared<Laws>();
  if (s.pressure_law.name != "power") laws->pressure = bekker::make_pressure_law(s.pressure_law.name, s.pressure_law.parameters);
  if (s.shear_law.name != "janosi") laws->shear = bekker::make_shear_law(s.shear_law.name, s.shear_law.parameters);
  out.law.pressure_law = laws->pressure.get();
  out.law.shear_law = laws->shear.get();
  out.owner = laws;
  return laws;
}

std::shared_ptr<const terrain::LayeredSoil> layers_of(const Scenario& s) {
  if (s.soil_layers.empty()) return nullptr;
  if (s.pressure_law.name != "power")
    throw InputError({s.file, 0, 0, "soil_layers", fmt::format("stand beside the law of pressure '{}', which knows no layers", s.pressure_law.name),
                      "laws.pressure: power"});
  std::vector<terrain::SoilLayer> layers;
  for (std::size_t i = 0; i < s.soil_layers.size(); ++i)
    layers.push_back({s.soil_layers[i].thickness.value_or(0.0),
                      s.bekker_soil(s.soil_layers[i].soil, fmt::format("soil_layers[{}].soil.", i))});
  return std::make_shared<terrain::LayeredSoil>(std::move(layers));
}

[[noreturn]] void refuse(const Scenario& s, const char* key, const std::string& method) {
  throw InputError({s.file, 0, 0, key, fmt::format("is what the method {} does not know", method), "the method node-spring alone"});
}

}  // namespace

std::shared_ptr<const Surface> make_surface(const std::vector<SurfacePart>& parts) {
  const bool level = std::all_of(parts.begin(), parts.end(), [](const SurfacePart& p) { return p.kind == "level" && p.height == 0.0; });
  return level ? nullptr : sum_of(parts, false);
}

std::shared_ptr<const Surface> with_bed(std::shared_ptr<const Surface> surface, const effects::EffectSet& effects) {
  if (!effects.has_bed()) return surface;
  auto bed = std::make_shared<Bed>(effects);
  if (surface == nullptr) return bed;
  return std::make_shared<Sum>(std::vector<std::shared_ptr<const Surface>>{std::move(surface), std::move(bed)});
}

std::shared_ptr<const terrain::SoilField> soil_field(const Scenario& s) {
  std::vector<std::shared_ptr<const terrain::SoilField>> fields;
  if (auto layers = layers_of(s)) fields.push_back(std::move(layers));
  std::vector<terrain::SoilPatch> rectangles;
  const auto put_rectangles = [&] {
    if (!rectangles.empty()) fields.push_back(std::make_shared<terrain::SoilMap>(std::exchange(rectangles, {})));
  };
  for (std::size_t i = 0; i < s.soil_map.size(); ++i) {
    const SoilPlace& place = s.soil_map[i];
    const bekker::Soil soil = s.bekker_soil(place.soil, fmt::format("soil_map[{}].soil.", i));
    if (place.share_surface) {
      put_rectangles();
      fields.push_back(std::make_shared<terrain::SoilBlend>(place.share_surface, soil));
    } else {
      rectangles.push_back({place.x0.value_or(0.0), place.y0.value_or(0.0), place.x1.value_or(0.0), place.y1.value_or(0.0), soil});
    }
  }
  put_rectangles();
  if (fields.empty()) return nullptr;
  return fields.size() == 1 ? fields.front() : std::make_shared<terrain::SoilFields>(std::move(fields));
}

GroundLaw point_law(const Scenario& s) {
  GroundLaw law;
  make_laws(s, law);
  return law;
}

GroundLaw placeless_law(const Scenario& s) {
  if (s.surface) refuse(s, "surface", "steady");
  if (!s.soil_map.empty()) refuse(s, "soil_map", "steady");
  GroundLaw law;
  const auto laws = make_laws(s, law);
  if (const auto layers = layers_of(s)) {
    laws->made.push_back(std::make_unique<terrain::FieldModifier>(layers));
    for (const double depth : layers->boundaries()) laws->made.push_back(std::make_unique<terrain::LayerCorner>(depth));
    for (const auto& m : laws->made) laws->modifiers.push_back(m.get());
    law.law.modifiers = laws->modifiers;
  }
  return law;
}

void refuse_for_particles(const Scenario& s, const std::string& method) {
  if (s.surface) refuse(s, "surface", method);
  if (!s.soil_map.empty()) refuse(s, "soil_map", method);
  if (!s.soil_layers.empty()) refuse(s, "soil_layers", method);
}

std::string ground_files(const Scenario& s) {
  Node names = Node::sequence();
  for (const SurfacePart& p : s.surface_parts) names.items.push_back(Node::scalar(p.file));
  for (const SoilPlace& place : s.soil_map)
    for (const SurfacePart& p : place.share) names.items.push_back(Node::scalar(p.file));
  std::string out;
  const std::string lines = named_files(names, "/");
  for (std::size_t at = 0; at < lines.size();) {
    const std::size_t end = std::min(lines.find('\n', at), lines.size());
    out += "# " + lines.substr(at, end - at) + "\n";
    at = end + 1;
  }
  return out;
}

Section laws_section() {
  Section section;
  section.name = "laws";
  section.read = read_laws;
  section.write = write_laws;
  section.schema = laws_schema;
  return section;
}

Section surface_section() {
  Section section;
  section.name = "surface";
  section.read = [](const Node& node, const std::string& key, Source& source, Scenario& out) {
    out.surface_parts = read_parts(node, key, source, false);
    out.surface = make_surface(out.surface_parts);
  };
  section.write = [](const Scenario& in) -> std::optional<Node> {
    if (in.surface_parts.empty()) return std::nullopt;
    return write_parts(in.surface_parts, false);
  };
  section.schema = [] { return parts_schema("m", "the ground before anything touched it; a list is added up"); };
  return section;
}

Section soil_map_section() {
  Section section;
  section.name = "soil_map";
  section.read = [](const Node& node, const std::string& key, Source& source, Scenario& out) {
    if (node.kind != Node::Kind::sequence) return source.problem(node, key, "is no list", "a list of places, each with its soil");
    for (std::size_t i = 0; i < node.items.size(); ++i) {
      const Node& item = node.items[i];
      MapReader map(item, fmt::format("{}[{}]", key, i), source);
      const std::size_t before = source.problems.size();
      SoilPlace place;
      place.soil = out.soil;
      if (const Node* share = map.find("share")) {
        place.share = read_parts(*share, map.key("share"), source, true);
        if (source.problems.size() == before) place.share_surface = sum_of(place.share, true);
      }
      for (const auto& [name, value] : {std::pair{"x0", &place.x0}, {"y0", &place.y0}, {"x1", &place.x1}, {"y1", &place.y1}}) {
        if (map.has("share") && map.has(name)) source.problem(item, map.key(name), "stands beside share", "one of the two");
        if (!map.has("share")) map.need(name);
        *value = map.number(name, "m");
      }
      if (place.x0 && place.x1 && place.y0 && place.y1 && !(*place.x1 > *place.x0 && *place.y1 > *place.y0))
        source.problem(item, map.key("x1"), "makes an empty rectangle", "x1 above x0 and y1 above y0");
      if (const Node* soil = map.need("soil")) read_other_soil(*soil, map.key("soil"), source, place.soil);
      map.finish();
      if (source.problems.size() > before) continue;
      check_other_soil(out, place.soil, item, fmt::format("{}[{}]", key, i), source);
      out.soil_map.push_back(std::move(place));
    }
  };
  section.write = [](const Scenario& in) -> std::optional<Node> {
    if (in.soil_map.empty()) return std::nullopt;
    Node list = Node::sequence();
    for (const SoilPlace& place : in.soil_map) {
      Node one = Node::map();
      if (place.share_surface) one.set("share", write_parts(place.share, true));
      for (const auto& [name, value] : {std::pair{"x0", place.x0}, {"y0", place.y0}, {"x1", place.x1}, {"y1", place.y1}})
        if (value) one.set(name, quantity_node(*value, "m"));
      one.set("soil", soil_table().write(place.soil));
      list.items.push_back(std::move(one));
    }
    return list;
  };
  section.schema = [] {
    const auto m = [](const char* text) { return quantity_schema("m", any_number(), text); };
    return Json{{"type", "array"},
                {"description", "other soils by place; the last one that holds a point counts"},
                {"items",
                 {{"type", "object"},
                  {"additionalProperties", false},
                  {"properties",
                   {{"x0", m("of the rectangle")},
                    {"y0", m("of the rectangle")},
                    {"x1", m("of the rectangle")},
                    {"y1", m("of the rectangle")},
                    {"share", parts_schema("", "in place of a rectangle: how much of this soil, from 0 to 1, as heights of a surface")},
                    {"soil", soil_section().schema()}}},
                  {"required", Json::array({"soil"})}}}};
  };
  return section;
}

Section soil_layers_section() {
  Section section;
  section.name = "soil_layers";
  section.read = [](const Node& node, const std::string& key, Source& source, Scenario& out) {
    if (node.kind != Node::Kind::sequence) return source.problem(node, key, "is no list", "a list of layers from the top down");
    for (std::size_t i = 0; i < node.items.size(); ++i) {
      const Node& item = node.items[i];
      MapReader map(item, fmt::format("{}[{}]", key, i), source);
      const std::size_t before = source.problems.size();
      LayerOfSoil layer;
      layer.soil = out.soil;
      const bool last = i + 1 == node.items.size();
      if (!last) map.need("thickness");
      layer.thickness = map.number("thickness", "m", above(0));
      if (last && layer.thickness)
        source.note(item, map.key("thickness"), "is of the last layer, which goes on for ever");
      if (const Node* soil = map.find("soil")) read_other_soil(*soil, map.key("soil"), source, layer.soil);
      map.finish();
      if (source.problems.size() > before) continue;
      check_other_soil(out, layer.soil, item, fmt::format("{}[{}]", key, i), source);
      out.soil_layers.push_back(std::move(layer));
    }
    if (out.pressure_law.name != "power")
      source.problem(node, key, fmt::format("stands beside the law of pressure '{}', which knows no layers", out.pressure_law.name),
                     "laws.pressure: power");
  };
  section.write = [](const Scenario& in) -> std::optional<Node> {
    if (in.soil_layers.empty()) return std::nullopt;
    Node list = Node::sequence();
    for (const LayerOfSoil& layer : in.soil_layers) {
      Node one = Node::map();
      if (layer.thickness) one.set("thickness", quantity_node(*layer.thickness, "m"));
      one.set("soil", soil_table().write(layer.soil));
      list.items.push_back(std::move(one));
    }
    return list;
  };
  section.schema = [] {
    return Json{{"type", "array"},
                {"description", "soil by depth, from the top down; the last layer goes on for ever"},
                {"items",
                 {{"type", "object"},
                  {"additionalProperties", false},
                  {"properties",
                   {{"thickness", quantity_schema("m", above(0), "of the layer")}, {"soil", soil_section().schema()}}}}}};
  };
  return section;
}

}  // namespace terrode::scenario
