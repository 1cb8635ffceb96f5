#include "scenario/vehicle_file.h"

#include <filesystem>

#include "scenario/methods.h"
#include "scenario/section.h"
#include "terrain/rigid.h"
#include "terrain/surfaces.h"
#include "vehicle/machines.h"

namespace terrode::scenario {

namespace {

using namespace vehicle;

void vector3(MapReader& map, const std::string& key, const std::string& unit, Vec3& out) {
  if (!map.has(key)) return;
  const std::size_t before = map.source().problems.size();
  const std::vector<double> v = map.numbers(key, unit);
  if (v.size() == 3)
    out = Vec3(v[0], v[1], v[2]);
  else if (map.source().problems.size() == before)
    map.source().problem(*map.find(key), map.key(key), "has " + std::to_string(v.size()) + " numbers",
                         "three: x, y, z");
}

void take(double& out, const std::optional<double>& value) {
  if (value) out = *value;
}

std::string text_of(MapReader& map, const std::string& key) {
  map.need(key);
  return map.text(key).value_or("");
}

SpringSpec read_spring(MapReader& map, bool angular) {
  SpringSpec s;
  take(s.stiffness, map.number("stiffness", angular ? "N m/rad" : "N/m", at_least(0)));
  take(s.damping, map.number("damping", angular ? "N m s/rad" : "N s/m", at_least(0)));
  take(s.preload, map.number("preload", angular ? "N m" : "N"));
  return s;
}

DriveSpec read_drive(MapReader& map) {
  DriveSpec d;
  const std::string kind = map.choice("kind", {"free", "speed", "torque", "dc_motor"}).value_or("speed");
  d.kind = kind == "free"     ? DriveKind::free
           : kind == "torque" ? DriveKind::torque
           : kind == "speed"  ? DriveKind::speed
                              : DriveKind::dc_motor;
  take(d.max_torque, map.number("max_torque", "N m", above(0)));
  DcMotorSpec& m = d.motor;
  take(m.voltage, map.number("voltage", "V", above(0)));
  take(m.resistance, map.number("resistance", "Ohm", above(0)));
  take(m.torque_constant, map.number("torque_constant", "N m/A", above(0)));
  take(m.gear, map.number("gear", "-", above(0)));
  take(m.efficiency, map.number("efficiency", "-", {0, 1, true, false}));
  take(m.current_limit, map.number("current_limit", "A", above(0)));
  take(m.speed_gain, map.number("speed_gain", "V s/rad", at_least(0)));
  map.finish();
  return d;
}

VehicleWheelSpec read_wheel(MapReader& map) {
  VehicleWheelSpec w;
  w.name = text_of(map, "name");
  w.parent = text_of(map, "parent");
  map.need("centre");
  vector3(map, "centre", "m", w.centre);
  map.need("mass");
  take(w.mass, map.number("mass", "kg", above(0)));
  map.need("radius");
  take(w.shape.radius, map.number("radius", "m", above(0)));
  map.need("width");
  take(w.shape.width, map.number("width", "m", above(0)));
  take(w.shape.crown_radius, map.number("crown_radius", "m", at_least(0)));
  if (auto g = map.section("grousers")) {
    if (const auto count = g->integer("count", 0, 1000)) w.shape.grousers.count = static_cast<int>(*count);
    take(w.shape.grousers.height, g->number("height", "m", above(0)));
    w.shape.grousers.thickness = g->number("thickness", "m", above(0)).value_or(0.003);
    g->finish();
  }
  if (auto d = map.section("drive")) w.drive = read_drive(*d);
  if (auto s = map.section("strut")) {
    StrutSpec strut;
    strut.spring = read_spring(*s, false);
    take(strut.upright_mass, s->number("upright_mass", "kg", above(0)));
    s->finish();
    w.strut = strut;
  }
  if (auto s = map.section("steering")) {
    SteeringSpec steering;
    take(steering.limit, s->number("limit", "rad", above(0)));
    take(steering.rate, s->number("rate", "rad/s", above(0)));
    take(steering.response, s->number("response", "s", above(0)));
    take(steering.knuckle_mass, s->number("knuckle_mass", "kg", above(0)));
    s->finish();
    w.steering = steering;
  }
  map.finish();
  return w;
}

VehicleSpec read_machine(const Node& node, const std::string& key, Source& source) {
  VehicleSpec v;
  const std::size_t before = source.problems.size();
  MapReader map(node, key, source);
  v.name = text_of(map, "name");
  vector3(map, "hitch", "m", v.hitch);
  for (const auto& [item_key, item] : map.items("bodies")) {
    MapReader m(*item, item_key, source);
    BodySpec b;
    b.name = text_of(m, "name");
    m.need("mass");
    take(b.mass, m.number("mass", "kg", above(0)));
    vector3(m, "position", "m", b.position);
    vector3(m, "size", "m", b.size);
    if (m.has("inertia")) {
      Vec3 moments = Vec3::Zero();
      vector3(m, "inertia", "kg m^2", moments);
      b.inertia = Mat3(moments.asDiagonal());
    }
    m.finish();
    v.bodies.push_back(b);
  }
  for (const auto& [item_key, item] : map.items("joints")) {
    MapReader m(*item, item_key, source);
    JointSpec j;
    j.name = text_of(m, "name");
    m.need("kind");
    const std::string kind = m.choice("kind", {"fixed", "hinge", "slider", "ball", "rod"}).value_or("hinge");
    j.kind = kind == "fixed"    ? JointKind::fixed
             : kind == "slider" ? JointKind::slider
             : kind == "ball"   ? JointKind::ball
             : kind == "rod"    ? JointKind::rod
                                : JointKind::hinge;
    j.body = text_of(m, "body");
    j.parent = text_of(m, "parent");
    vector3(m, "anchor", "m", j.anchor);
    vector3(m, "anchor_on_parent", "m", j.anchor_on_parent);
    vector3(m, "axis", "-", j.axis);
    if (auto s = m.section("spring")) {
      j.spring = read_spring(*s, j.kind == JointKind::hinge);
      s->finish();
    }
    m.finish();
    v.joints.push_back(j);
  }
  for (const auto& [item_key, item] : map.items("wheels")) {
    MapReader m(*item, item_key, source);
    v.wheels.push_back(read_wheel(m));
  }
  map.finish();
  if (source.problems.size() == before) {
    for (Problem p : v.validate()) {
      p.file = source.file;
      p.line = node.line;
      p.column = node.column;
      p.key = key.empty() ? p.key : key + "." + p.key;
      source.problems.push_back(p);
    }
  }
  return v;
}

std::shared_ptr<const terrain::Surface> read_surface(MapReader& map) {
  const std::string kind = map.choice("kind", {"level", "slope", "fractal", "png", "ascii"}).value_or("level");
  std::shared_ptr<const terrain::Surface> out;
  Source& source = map.source();
  std::string path;
  if (kind == "png" || kind == "ascii") {
    const std::size_t before = source.problems.size();
    path = named_path(map.text("file").value_or(""), map.node(), map.key("file"), source);
    map.need("file");
    if (source.problems.size() > before) return nullptr;
  }
  try {
    if (kind == "slope") {
      const double angle = map.number("angle", "rad", between(-1.2, 1.2)).value_or(0.0);
      out = std::make_shared<terrain::SlopeSurface>(angle, map.number("azimuth", "rad").value_or(0.0));
    } else if (kind == "fractal") {
      terrain::FractalParams p;
      take(p.rms_height, map.number("rms_height", "m", at_least(0)));
      take(p.hurst, map.number("hurst", "-", {0, 1, true, false}));
      take(p.longest, map.number("longest", "m", above(0)));
      take(p.shortest, map.number("shortest", "m", above(0)));
      if (const auto seed = map.integer("seed", 0, 1L << 40)) p.seed = static_cast<std::uint64_t>(*seed);
      out = std::make_shared<terrain::FractalSurface>(p);
    } else if (kind == "png") {
      map.need("cell");
      map.need("white");
      const double cell = map.number("cell", "m", above(0)).value_or(1.0);
      const double black = map.number("black", "m").value_or(0.0), white = map.number("white", "m").value_or(0.0);
      const double x0 = map.number("x0", "m").value_or(0.0), y0 = map.number("y0", "m").value_or(0.0);
      out = std::make_shared<terrain::GridSurface>(
          terrain::read_png_heights(path, cell, black, white, x0, y0));
    } else if (kind == "ascii") {
      out = std::make_shared<terrain::GridSurface>(terrain::read_ascii_heights(path));
    }
  } catch (const InputError& e) {
    for (const Problem& p : e.problems()) source.problem(map.node(), map.key(p.key), p.message, p.expected);
  }
  map.finish();
  return out;
}

void read_script(MapReader& map, DriveScenario& out) {
  for (const auto& [key, item] : map.items("script")) {
    MapReader m(*item, key, map.source());
    Manoeuvre x;
    x.duration = m.number("duration", "s", above(0));
    x.distance = m.number("distance", "m", above(0));
    take(x.ramp, m.number("ramp", "s", at_least(0)));
    take(x.speed, m.number("speed", "m/s"));
    take(x.curvature, m.number("curvature", "1/m"));
    take(x.yaw_rate, m.number("yaw_rate", "rad/s"));
    take(x.hitch_pull, m.number("hitch_pull", "N"));
    take(x.torque, m.number("torque", "N m"));
    m.finish();
    for (const Problem& p : x.validate(key)) map.source().problem(*item, p.key, p.message, p.expected);
    out.script.push_back(x);
  }
  if (auto path = map.section("path")) {
    for (const auto& [key, item] : path->items("waypoints")) {
      const std::vector<double> p = read_numbers(*item, key, "m", any_number(), map.source());
      if (p.size() == 2)
        out.waypoints.emplace_back(p[0], p[1]);
      else
        map.source().problem(*item, key, "has " + std::to_string(p.size()) + " numbers", "two: x, y");
    }
    take(out.path.speed, path->number("speed", "m/s", above(0)));
    take(out.path.lookahead, path->number("lookahead", "m", above(0)));
    take(out.path.largest_curvature, path->number("largest_curvature", "1/m", above(0)));
    take(out.path.tolerance, path->number("tolerance", "m", above(0)));
    take(out.path.ramp, path->number("ramp", "s", at_least(0)));
    path->finish();
  }
  if (out.script.empty() == out.waypoints.empty())
    map.source().problem(map.node(), "script", "and path are both given or both missing", "one of them");
}

}  // namespace

bool is_drive(const std::string& path) {
  if (std::filesystem::is_directory(path)) return false;
  const Node root = read_yaml(path);
  return root.find("vehicle") != nullptr;
}

VehicleSpec parse_machine(const std::string& text, const std::string& file) {
  const Node root = parse_yaml(text, file);
  Source source{file, {}, {}};
  VehicleSpec out = read_machine(root, "", source);
  throw_if_any(source.problems);
  return out;
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
  if (!out.machine.wheels.empty()) {
    out.base.wheel.radius = out.machine.wheels.front().shape.radius;
    out.base.wheel.width = out.machine.wheels.front().shape.width;
  }
  if (const auto g = map.choice("ground", {"node-spring", "rigid"})) out.ground = *g;
  if (out.ground == "node-spring") map.need("soil");
  for (const Section& section : {soil_section(), terrain_section(), effects_section()})
    if (const Node* node = map.find(section.name)) section.read(*node, section.name, source, out.base);
  if (auto s = map.section("surface")) out.surface = read_surface(*s);
  double gravity = 9.81, slope = 0.0;
  take(gravity, map.number("gravity", "m/s^2", above(0)));
  take(slope, map.number("slope", "rad", between(-1.2, 1.2)));
  out.options.gravity = gravity * Vec3(-std::sin(slope), 0.0, -std::cos(slope));
  take(out.options.start_x, map.number("start_x", "m"));
  take(out.options.start_y, map.number("start_y", "m"));
  take(out.options.start_heading, map.number("start_heading", "rad"));
  take(out.options.time_step, map.number("time_step", "s", {0, 0.1, true, false}));
  take(out.options.sample_interval, map.number("sample_interval", "s", at_least(0)));
  take(out.options.settle_time, map.number("settle_time", "s", above(0)));
  read_script(map, out);
  double total = 0.0;
  bool timed = !out.script.empty();
  for (const Manoeuvre& m : out.script) {
    timed = timed && m.duration.has_value();
    total += m.duration.value_or(0.0);
  }
  if (timed) out.duration = total;
  take(out.duration, map.number("duration", "s", above(0)));
  map.finish();
  throw_if_any(source.problems);
  out.base.notes = source.notes;
  return out;
}

DriveScenario load_drive(const std::string& path) {
  return parse_drive(read_text_file(path, ReadLimits{}.bytes), path);
}

std::unique_ptr<terrain::Terrain> DriveScenario::make_ground(const effects::EffectSet& effects) const {
  if (ground == "rigid") return std::make_unique<terrain::RigidTerrain>();
  bekker::PointLaw law;
  law.modifiers = effects.modifiers();
  return std::make_unique<terrain::NodeSpringTerrain>(node_spring_params(base), law, surface);
}

std::unique_ptr<vehicle::Controller> DriveScenario::make_controller() const {
  if (!script.empty()) return std::make_unique<Script>(script);
  return std::make_unique<PathFollower>(waypoints, path);
}

DriveResult run_drive(const DriveScenario& drive, const Progress& progress, const DriveObserver& observe,
                      const recording::Checkpoint* resume) {
  const effects::EffectSet effects = effect_set(drive.base);
  Vehicle v(drive.machine, drive.options, drive.make_ground(effects));
  const auto controller = drive.make_controller();
  if (resume) v.resume(*resume, *controller);
  if (observe) v.set_observer([&](Vehicle& vehicle) { observe(vehicle, *controller); });
  DriveResult out;
  out.run = v.run(*controller, drive.duration, progress);
  out.run.id = drive.machine.name;
  out.events = v.events();
  out.simulated_seconds = v.time();
  out.energy = v.energy();
  double drives = 0.0;
  for (const WheelSample& w : v.last().wheels) drives += w.energy;
  if (v.last().travel > 1e-6) out.energy_per_metre = drives / v.last().travel;
  return out;
}

}  // namespace terrode::scenario
