#include "scenario/vehicle_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "scenario/dem_file.h"
#include "scenario/methods.h"
#include "scenario/section.h"
#include "terrain/rigid.h"
#include "vehicle/machines.h"

namespace terrode::scenario {

namespace {

using namespace vehicle;

constexpr double earth = 9.81, moon = 1.62, mars = 3.71;  // m/s2

Table<Manoeuvre> manoeuvre_table() {
  Table<Manoeuvre> t;
  t.number("duration", "s", above(0), &Manoeuvre::duration, "after which it ends")
      .number("distance", "m", above(0), &Manoeuvre::distance, "of path after which it ends")
      .number("ramp", "s", at_least(0), &Manoeuvre::ramp, "in which its values are reached")
      .number("speed", "m/s", any_number(), &Manoeuvre::speed, "of the machine's origin")
      .number("curvature", "1/m", any_number(), &Manoeuvre::curvature, "of its path, left positive")
      .number("yaw_rate", "rad/s", any_number(), &Manoeuvre::yaw_rate, "of a turn in place")
      .number("hitch_pull", "N", any_number(), &Manoeuvre::hitch_pull, "of a drawbar load, backwards")
      .number("torque", "N m", any_number(), &Manoeuvre::torque, "command of torque drives");
  return t;
}

using Waypoint = Eigen::Vector2d;

Table<DriveScenario> path_table() {
  using Options = PathFollower::Options;
  Table<Options> options;
  options.number("speed", "m/s", above(0), &Options::speed, "along the path")
      .number("lookahead", "m", above(0), &Options::lookahead, "of pure pursuit")
      .number("largest_curvature", "1/m", above(0), &Options::largest_curvature, "that is steered")
      .number("tolerance", "m", above(0), &Options::tolerance, "of the last point")
      .number("ramp", "s", at_least(0), &Options::ramp, "in which the speed rises");
  const Json point = {{"type", "array"}, {"items", quantity_schema("m", any_number(), "")}, {"minItems", 2}, {"maxItems", 2}};
  Table<DriveScenario> t;
  t.add({"waypoints", false, {{"type", "array"}, {"description", "x, y of each"}, {"items", point}},
         [](MapReader& map, DriveScenario& out) {
           for (const auto& [key, item] : map.items("waypoints")) {
             const std::vector<double> p = read_numbers(*item, key, "m", any_number(), map.source());
             if (p.size() == 2)
               out.waypoints.emplace_back(p[0], p[1]);
             else
               map.source().problem(*item, key, "has " + std::to_string(p.size()) + " numbers", "two: x, y");
           }
         },
         [](const DriveScenario& in) -> std::optional<Node> {
           Node list = Node::sequence();
           for (const Waypoint& w : in.waypoints) {
             Node one = Node::sequence();
             for (const double v : w) one.items.push_back(quantity_node(v, "m"));
             list.items.push_back(std::move(one));
           }
           return list;
         }});
  t.embed(&DriveScenario::path, options);
  return t;
}

void read_script(MapReader& map, DriveScenario& out) {
  for (const auto& [key, item] : map.items("script")) {
    MapReader m(*item, key, map.source());
    manoeuvre_table().read(m, out.script.emplace_back());
    for (const Problem& p : out.script.back().validate(key)) map.source().problem(*item, p.key, p.message, p.expected);
  }
  if (auto path = map.section("path")) path_table().read(*path, out);
  if (out.script.empty() == out.waypoints.empty())
    map.source().problem(map.node(), "script", "and path are both given or both missing", "one of them");
}

// Settings of the machine's run that stand alone, each a key of the file.
Table<VehicleOptions> options_table() {
  using O = VehicleOptions;
  Table<O> margin;
  margin.number("every", "s", above(0), &O::margin_interval, "at which it is measured")
      .required()
      .number("largest", "N", above(0), &O::margin_largest, "that is tried; absent: the machine's weight")
      .number("rate", "N/s", above(0), &O::margin_rate, "at which the pull rises; absent: a tenth of the weight a second");
  using Law = multibody::ContactLaw;
  Table<Law> contact;
  contact.number("friction", "-", at_least(0), &Law::friction, "Coulomb's mu")
      .number("stiffness", "N/m", above(0), &Law::stiffness, "of each contact point")
      .number("damping", "N s/m", at_least(0), &Law::damping, "of each contact point");
  Table<O> t;
  t.number("start_x", "m", any_number(), &O::start_x, "where the machine is set down")
      .number("start_y", "m", any_number(), &O::start_y, "where the machine is set down")
      .number("start_heading", "rad", any_number(), &O::start_heading, "from x towards y")
      .number("time_step", "s", from_to(multibody::kShortestStep, 0.1), &O::time_step, "of the machine")
      .number("sample_interval", "s", at_least(0), &O::sample_interval, "over which samples are means")
      .number("settle_time", "s", above(0), &O::settle_time, "in which gravity comes on")
      .number("immobile_time", "s", above(0), &O::immobile_time, "over which a machine that makes no way counts as immobilised")
      .group("mobility_margin", margin, "how much more it could pull, measured on the way")
      .section("rock_contact", &O::rock_contact, contact, "of rocks with wheels, bodies and each other");
  return t;
}

// The ground, as in a rig's scenario.
std::vector<Section> ground_sections() {
  return {soil_section(), terrain_section(), particles_section(), effects_section(), laws_section(), surface_section(), soil_map_section(),
          soil_layers_section()};
}

// A number, or the name of a world.
double read_gravity(MapReader& map) {
  const Node* node = map.find("gravity");
  if (node == nullptr) return earth;
  for (const auto& [name, g] : {std::pair{"earth", earth}, {"moon", moon}, {"mars", mars}})
    if (node->kind == Node::Kind::scalar && node->text == name) return g;
  if (node->kind == Node::Kind::scalar && !node->text.empty() && std::isalpha(static_cast<unsigned char>(node->text[0]))) {
    map.source().problem(*node, "gravity", "is '" + node->text + "'", "earth, moon, mars or an acceleration");
    return earth;
  }
  return map.number("gravity", "m/s^2", above(0)).value_or(earth);
}

// What gravity does to the machine is plain; what it does to the soil is a choice, which is said.
void read_soil_gravity(MapReader& map, double gravity, DriveScenario& out) {
  const auto choice = map.choice("soil_measured_at", {"here", "earth"});
  if (gravity == earth || out.ground == "rigid") return;
  if (out.on_particles()) {
    out.base.notes.push_back(fmt::format("gravity {:.4g} m/s2 acts on the machine and on every grain", gravity));
    return;
  }
  if (choice.value_or("here") == "here") {
    out.base.notes.push_back(fmt::format(
        "gravity {:.4g} m/s2 acts on the machine; the soil's parameters are taken as measured there and stay as given "
        "(soil_measured_at: earth scales k and the unit weight by {:.4g})",
        gravity, gravity / earth));
    return;
  }
  for (const EffectSpec& e : out.base.effects)
    if (e.id == "gravity") {
      map.source().problem(map.node(), "soil_measured_at", "stands beside the effect gravity", "one of the two");
      return;
    }
  out.base.effects.push_back({"gravity", {{"g", gravity}}});
  out.base.notes.push_back(fmt::format(
      "gravity {:.4g} m/s2 acts on the machine; of the soil, measured on Earth, it scales k and the unit weight by {:.4g} "
      "and leaves cohesion, friction angle, n and K as they are (the effect gravity)",
      gravity, gravity / earth));
}

}  // namespace

bool is_drive(const std::string& path) {
  if (std::filesystem::is_directory(path)) return false;
  const Node root = read_yaml(path);
  return root.find("vehicle") != nullptr;
}

bool is_machine(const std::string& path) {
  if (std::filesystem::is_directory(path)) return false;
  const Node root = read_yaml(path);
  return root.find("vehicle") == nullptr && (root.find("urdf") != nullptr || root.find("wheels") != nullptr);
}

DriveScenario parse_drive(const std::string& text, const std::string& file) {
  const Node root = parse_yaml(text, file);
  Source source{file, {}, {}};
  DriveScenario out;
  out.file = file;
  out.text = text;
  out.base.file = file;
  MapReader map(root, "", source);
  if (const auto title = map.text("title")) out.base.title = *title;
  if (const auto seed = map.integer("seed", 0, 2147483647)) out.base.seed = static_cast<int>(*seed);
  out.options.seed = static_cast<std::uint64_t>(out.base.seed);
  if (const Node* v = map.need("vehicle")) {
    const bool name = v->kind == Node::Kind::scalar && v->text.find('.') == std::string::npos;
    if (name) {
      try {
        out.machine = machine(v->text);
      } catch (const InputError& e) {
        for (const Problem& p : e.problems()) source.problem(*v, "vehicle", p.message, p.expected);
      }
    } else {
      inline_or_file(*v, "vehicle", source,
                     [&](const Node& n, const std::string& k, Source& s) { out.machine = read_machine(n, k, s); });
    }
  }
  double reach = 0.0;  // of the machine in plan
  for (const VehicleWheelSpec& w : out.machine.wheels)
    reach = std::max(reach, w.centre.head<2>().norm() + w.shape.radius + 0.5 * w.shape.width);
  if (!out.machine.wheels.empty()) {
    out.base.wheel.radius = out.machine.wheels.front().shape.radius;
    out.base.wheel.width = out.machine.wheels.front().shape.width;
  }
  if (const auto g = map.choice("ground", {"node-spring", "rigid", "dem", "mpi"})) out.ground = *g;
  if (out.ground == "node-spring") map.need("soil");
  for (const Section& section : ground_sections())
    if (const Node* node = map.find(section.name)) section.read(*node, section.name, source, out.base);
  const double gravity = read_gravity(map);
  read_soil_gravity(map, gravity, out);
  double slope = 0.0;
  set_if(slope, map.number("slope", "rad", between(-1.2, 1.2)));
  out.options.gravity = gravity * Vec3(-std::sin(slope), 0.0, -std::cos(slope));
  options_table().read_known(map, out.options);
  out.options.rocks = read_rocks(map, out.options.start_x, out.options.start_y, reach);
  if (out.ground != "node-spring") {
    const auto only = [&](const char* key, bool there) {
      if (there)
        source.problem(*map.find(key), key, "stands on " + out.ground + " ground, which is level and uniform", "ground: node-spring");
    };
    only("surface", out.base.surface != nullptr);
    only("soil_map", !out.base.soil_map.empty());
    only("soil_layers", !out.base.soil_layers.empty());
    if (out.on_particles()) {
      only("slope", slope != 0.0);
      only("start_heading", out.options.start_heading != 0.0);
    }
  }
  if (out.ground == "mpi" && out.options.margin_interval > 0.0)
    source.problem(*map.find("mobility_margin"), "mobility_margin", "drives on beyond script and path, as far as which ground mpi is laid", "ground: dem");
  if (!out.on_particles() && map.has("particles"))
    source.problem(*map.find("particles"), "particles", "are of ground dem or mpi, and this is " + out.ground, "ground: dem");
  read_script(map, out);
  double total = 0.0;
  bool timed = !out.script.empty();
  for (const Manoeuvre& m : out.script) {
    timed = timed && m.duration.has_value();
    total += m.duration.value_or(0.0);
  }
  if (timed) out.duration = total;
  set_if(out.duration, map.number("duration", "s", above(0)));
  map.finish();
  throw_if_any(source.problems);
  out.base.notes.insert(out.base.notes.begin(), source.notes.begin(), source.notes.end());
  return out;
}

std::string vehicle_schema() {
  const auto choice = [](std::vector<std::string> words, const char* text) { return Json{{"enum", std::move(words)}, {"description", text}}; };
  Json properties = Json::object();
  properties["title"] = {{"type", "string"}};
  properties["seed"] = {{"type", "integer"}, {"minimum", 0}, {"description", "of sensor noise"}};
  Json machine = machine_schema();
  machine["anyOf"].insert(machine["anyOf"].begin(), Json::object({{"type", "string"}}));
  machine["description"] = "a ready-made machine by name, the path of a file, or a machine in place";
  machine["examples"] = machine_names();
  properties["vehicle"] = machine;
  properties["ground"] = choice({"node-spring", "rigid", "dem", "mpi"}, "what the machine stands on");
  for (const Section& section : ground_sections()) properties[section.name] = section.schema();
  properties["gravity"] = {{"description", "a world or an acceleration [m/s^2]"},
                           {"anyOf", Json::array({Json{{"enum", {"earth", "moon", "mars"}}}, quantity_schema("m/s^2", above(0), "")})}};
  properties["soil_measured_at"] = choice({"here", "earth"}, "whether k and the unit weight scale with gravity");
  properties["slope"] = quantity_schema("rad", between(-1.2, 1.2), "tilts gravity so that +x is uphill");
  properties.update(options_table().schema()["properties"]);
  properties["rocks"] = rocks_schema();
  properties["rock_field"] = rock_field_schema();
  properties["script"] = {{"type", "array"}, {"items", manoeuvre_table().schema()}, {"description", "manoeuvres one after the other"}};
  properties["path"] = path_table().schema();
  properties["duration"] = quantity_schema("s", above(0), "of the run, at most");
  const Json schema = {{"$schema", "https://json-schema.org/draft/2020-12/schema"},
                       {"title", "Terrode vehicle scenario"},
                       {"type", "object"},
                       {"additionalProperties", false},
                       {"properties", properties},
                       {"required", {"vehicle"}}};
  return schema.dump(2) + "\n";
}

DriveScenario load_drive(const std::string& path) {
  return parse_drive(read_text_file(path, ReadLimits{}.bytes), path);
}

namespace {

// Half of what a machine is wide as it drives along x, and half of what it is in any direction: wheels and a radius beside
// them [m].
struct HalfWidth {
  double along = 0.0, turned = 0.0;
};

HalfWidth half_width(const VehicleSpec& machine) {
  HalfWidth out;
  for (const VehicleWheelSpec& w : machine.wheels) {
    const double beside = 0.5 * w.shape.width + w.shape.radius;
    out.along = std::max(out.along, std::abs(w.centre.y()) + beside);
    out.turned = std::max(out.turned, w.centre.head<2>().norm() + beside);
  }
  return out;
}

void widen(dem::DemTerrainParams& params, double half) {
  params.tiles_y = std::max(params.tiles_y, static_cast<int>(std::ceil(2.0 * half / params.prism.length)));
}

// As wide as the machine and a wheel's radius to either side.
std::unique_ptr<terrain::Terrain> dem_ground(const DriveScenario& drive, const Scenario& for_wheel, int threads, const Progress& progress) {
  dem::DemTerrainParams params = particle_params(for_wheel, threads, progress);
  widen(params, half_width(drive.machine).along);
  return std::make_unique<dem::DemTerrain>(std::move(params));
}

// Laid at once, as long and wide as the machine is meant to go, and a wheel's radius on.
std::unique_ptr<terrain::Terrain> mpi_ground(const DriveScenario& drive, const Scenario& for_wheel, int threads, const Progress& progress) {
  liggghts::LiggghtsParams params = liggghts_params(for_wheel, threads, progress);
  const HalfWidth half = half_width(drive.machine);
  const bool straight = drive.waypoints.empty() && std::all_of(drive.script.begin(), drive.script.end(), [](const Manoeuvre& m) {
                          return m.curvature == 0.0 && m.yaw_rate == 0.0;
                        });
  double behind = 0.0, ahead = 0.0, beside = 0.0;
  for (const Eigen::Vector2d& p : drive.planned_path()) {
    behind = std::max(behind, -p.x());
    ahead = std::max(ahead, p.x());
    beside = std::max(beside, std::abs(p.y()) + (straight ? half.along : half.turned));
  }
  params.reach_behind = behind + half.turned;
  params.reach_ahead = ahead + half.turned;
  widen(params.bed, beside);
  return liggghts_ground(for_wheel, std::move(params));
}

}  // namespace

void DriveScenario::require_particles(const effects::EffectSet& effects) const {
  if (effects.has_bed())
    throw InputError({file, 0, 0, "effects", "shape the bed, which particles do not know", "ground: node-spring"});
  if (ground == "mpi") require_liggghts_law(base);
}

std::unique_ptr<terrain::Terrain> DriveScenario::make_ground(const effects::EffectSet& effects, int threads, const Progress& progress) const {
  if (ground == "rigid") return std::make_unique<terrain::RigidTerrain>();
  if (on_particles()) {
    require_particles(effects);
    Scenario for_wheel = base;
    for_wheel.rig.gravity = options.gravity.norm();
    return ground == "mpi" ? mpi_ground(*this, for_wheel, threads, progress) : dem_ground(*this, for_wheel, threads, progress);
  }
  return node_spring_ground(base, effects);
}

std::unique_ptr<vehicle::Controller> DriveScenario::make_controller() const {
  if (!script.empty()) return std::make_unique<Script>(script);
  return std::make_unique<PathFollower>(waypoints, path);
}

DriveRun::DriveRun(const DriveScenario& drive, int threads, const Progress& progress)
    : drive_(drive),
      effects_(effect_set(drive.base)),
      vehicle_(drive.machine, drive.options, drive.make_ground(effects_, threads, progress)),
      controller_(drive.make_controller()) {}

void DriveRun::run(double until, const Progress& progress) {
  const double left = std::min(until, drive_.duration) - vehicle_.time();
  if (!(left > 0.5 * drive_.options.time_step))
    throw InputError({drive_.file, 0, 0, "duration", fmt::format("ends at {:.6g} s, which the run has reached", std::min(until, drive_.duration)),
                      "a later end"});
  vehicle_.run(*controller_, left, progress);
}

void DriveRun::take_up(const recording::Checkpoint& checkpoint) { vehicle_.resume(checkpoint, *controller_); }

DriveResult DriveRun::result() const {
  DriveResult out;
  out.run = vehicle_.so_far();
  out.run.id = drive_.machine.name;
  out.bodies = vehicle_.body_runs();
  out.events = vehicle_.events();
  out.margins = vehicle_.margins();
  out.end = vehicle_.end();
  out.simulated_seconds = vehicle_.time();
  out.energy = vehicle_.energy();
  double drives = 0.0;
  for (const WheelSample& w : vehicle_.last().wheels) drives += w.energy;
  if (vehicle_.last().travel > 1e-6) out.energy_per_metre = drives / vehicle_.last().travel;
  return out;
}

DriveResult run_drive(const DriveScenario& drive, const Progress& progress) {
  DriveRun run(drive);
  run.run(drive.duration, progress);
  return run.result();
}

namespace {

constexpr const char* state_group = "/vehicle_state";

}  // namespace

void DriveRun::save(recording::Hdf5File& file) const {
  const VehicleState state = vehicle_.snapshot(controller_.get());
  const std::string group = state_group;
  file.create_group(group);
  file.set_attribute(group, "scenario", drive_.text);
  file.set_attribute(group, "time", vehicle_.time());
  file.write(group + "/world", state.simulation.world);
  file.write(group + "/contacts", state.simulation.contacts);
  file.write(group + "/machine", state.numbers);
  file.write(group + "/controller", state.controller);
  recording::ArrayOptions packed;
  packed.compression = 1;
  file.write(group + "/ground", state.simulation.ground, packed);
}

void DriveRun::resume(const recording::Hdf5File& file) {
  const std::string group = state_group;
  if (!file.is_group(group))
    throw InputError({file.path(), 0, 0, group, "is not in the file", "a result of 'terrode run --state'"});
  if (file.text_attribute(group, "scenario") != drive_.text)
    throw InputError({file.path(), 0, 0, group, "is the state of another scenario than " + drive_.file,
                      "the scenario with which it was saved"});
  VehicleState state;
  state.simulation.world = file.read<double>(group + "/world").values;
  state.simulation.contacts = file.read<double>(group + "/contacts").values;
  state.simulation.ground = file.read<std::uint8_t>(group + "/ground").values;
  state.numbers = file.read<double>(group + "/machine").values;
  state.controller = file.read<double>(group + "/controller").values;
  vehicle_.restore(state, controller_.get());
}

std::string DriveScenario::named_files() const {
  const auto of = [](const Node& root, const std::string& where) {
    return scenario::named_files(root, std::filesystem::path(where).parent_path().string());
  };
  const Node root = parse_yaml(text, file);
  std::string out = of(root, file);
  const Node* v = root.find("vehicle");
  if (v != nullptr && v->kind == Node::Kind::scalar && v->text.find('.') != std::string::npos) {
    const std::filesystem::path beside = std::filesystem::path(file).parent_path() / v->text;
    out += of(read_yaml(beside.string()), beside.string());
  }
  return out;
}

std::vector<Eigen::Vector2d> DriveScenario::planned_path() const {
  std::vector<Eigen::Vector2d> out = {{options.start_x, options.start_y}};
  if (script.empty()) {
    out.insert(out.end(), waypoints.begin(), waypoints.end());
    return out;
  }
  double heading = options.start_heading, time = 0.0;
  constexpr int pieces = 50;
  for (const Manoeuvre& m : script) {
    double seconds = m.duration.value_or(duration - time);
    if (m.distance && m.speed != 0.0) seconds = std::min(seconds, *m.distance / std::abs(m.speed));
    seconds = std::clamp(seconds, 0.0, std::max(0.0, duration - time));
    time += seconds;
    for (int i = 0; i < pieces; ++i) {
      const double step = m.speed * seconds / pieces;
      heading += 0.5 * (step * m.curvature + m.yaw_rate * seconds / pieces);
      out.push_back(out.back() + step * Eigen::Vector2d(std::cos(heading), std::sin(heading)));
      heading += 0.5 * (step * m.curvature + m.yaw_rate * seconds / pieces);
    }
  }
  return out;
}

}  // namespace terrode::scenario
