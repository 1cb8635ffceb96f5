#include "scenario/machine_file.h"

#include "scenario/section.h"
#include "scenario/urdf_file.h"
#include "wheel/convex.h"

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

std::string text_of(MapReader& map, const std::string& key) {
  map.need(key);
  return map.text(key).value_or("");
}

SpringSpec read_spring(MapReader& map, bool angular) {
  SpringSpec s;
  set_if(s.stiffness, map.number("stiffness", angular ? "N m/rad" : "N/m", at_least(0)));
  set_if(s.damping, map.number("damping", angular ? "N m s/rad" : "N s/m", at_least(0)));
  set_if(s.preload, map.number("preload", angular ? "N m" : "N"));
  return s;
}

DriveSpec read_drive(MapReader& map) {
  DriveSpec d;
  const std::string kind = map.choice("kind", {"free", "speed", "torque", "dc_motor"}).value_or("speed");
  d.kind = kind == "free"     ? DriveKind::free
           : kind == "torque" ? DriveKind::torque
           : kind == "speed"  ? DriveKind::speed
                              : DriveKind::dc_motor;
  set_if(d.max_torque, map.number("max_torque", "N m", above(0)));
  DcMotorSpec& m = d.motor;
  set_if(m.voltage, map.number("voltage", "V", above(0)));
  set_if(m.resistance, map.number("resistance", "Ohm", above(0)));
  set_if(m.torque_constant, map.number("torque_constant", "N m/A", above(0)));
  set_if(m.gear, map.number("gear", "-", above(0)));
  set_if(m.efficiency, map.number("efficiency", "-", {0, 1, true, false}));
  set_if(m.current_limit, map.number("current_limit", "A", above(0)));
  set_if(m.speed_gain, map.number("speed_gain", "V s/rad", at_least(0)));
  map.finish();
  return d;
}

// What a wheel is beside its place and mass; radius and width may come from elsewhere.
void read_wheel_parts(MapReader& map, VehicleWheelSpec& w) {
  set_if(w.shape.radius, map.number("radius", "m", above(0)));
  set_if(w.shape.width, map.number("width", "m", above(0)));
  set_if(w.shape.crown_radius, map.number("crown_radius", "m", at_least(0)));
  if (auto g = map.section("grousers")) {
    WheelSpec lugs;
    grouser_table().read(*g, lugs);
    w.shape.grousers = grousers_of(lugs);
  }
  if (auto d = map.section("drive")) w.drive = read_drive(*d);
  if (auto s = map.section("strut")) {
    StrutSpec strut;
    strut.spring = read_spring(*s, false);
    set_if(strut.upright_mass, s->number("upright_mass", "kg", above(0)));
    s->finish();
    w.strut = strut;
  }
  if (auto s = map.section("steering")) {
    SteeringSpec steering;
    set_if(steering.limit, s->number("limit", "rad", above(0)));
    set_if(steering.rate, s->number("rate", "rad/s", above(0)));
    set_if(steering.response, s->number("response", "s", above(0)));
    set_if(steering.knuckle_mass, s->number("knuckle_mass", "kg", above(0)));
    steering.joint = s->text("joint").value_or("");
    s->finish();
    w.steering = steering;
  }
}

// Convex hulls of points that press on the ground in place of the body's box.
void read_pieces(MapReader& map, BodySpec& b) {
  const std::size_t before = map.source().problems.size();
  for (const auto& [key, item] : map.items("pieces")) {
    std::vector<Vec3> points;
    for (std::size_t i = 0; i < item->items.size(); ++i) {
      const std::string at = key + "[" + std::to_string(i) + "]";
      const std::vector<double> p = read_numbers(item->items[i], at, "m", any_number(), map.source());
      if (p.size() == 3)
        points.emplace_back(p[0], p[1], p[2]);
      else
        map.source().problem(item->items[i], at, "has " + std::to_string(p.size()) + " numbers", "three: x, y, z");
    }
    b.pieces.push_back(std::move(points));
  }
  if (b.pieces.empty() || map.source().problems.size() > before) return;
  b.touches_ground = true;
  try {
    wheel::ConvexPieces{b.pieces};
  } catch (const InputError& e) {
    for (const Problem& p : e.problems()) map.source().problem(*map.find("pieces"), map.key("pieces"), p.message, p.expected);
  }
}

VehicleWheelSpec read_wheel(MapReader& map) {
  VehicleWheelSpec w;
  w.name = text_of(map, "name");
  w.parent = text_of(map, "parent");
  map.need("centre");
  vector3(map, "centre", "m", w.centre);
  map.need("mass");
  set_if(w.mass, map.number("mass", "kg", above(0)));
  if (map.has("inertia")) {
    Vec3 moments = Vec3::Zero();
    vector3(map, "inertia", "kg m^2", moments);
    w.inertia = Mat3(moments.asDiagonal());
  }
  map.need("radius");
  map.need("width");
  read_wheel_parts(map, w);
  map.finish();
  return w;
}

SensorSpec read_sensor(MapReader& m) {
  SensorSpec s;
  s.name = text_of(m, "name");
  m.need("kind");
  const std::string kind = m.choice("kind", {"imu", "encoder", "joint_load"}).value_or("imu");
  s.kind = kind == "encoder" ? SensorKind::encoder : kind == "joint_load" ? SensorKind::joint_load : SensorKind::imu;
  if (s.kind == SensorKind::imu) {
    s.body = text_of(m, "body");
    vector3(m, "position", "m", s.position);
  } else {
    s.joint = text_of(m, "joint");
  }
  set_if(s.noise, m.number("noise", "", at_least(0)));
  m.finish();
  return s;
}

JointSpec read_joint(MapReader& m) {
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
  return j;
}

// A machine from URDF, with what the sidecar says beside it.
VehicleSpec read_urdf_machine(MapReader& map) {
  Source& source = map.source();
  UrdfSidecar sidecar;
  if (const Node* file = map.need("urdf")) sidecar.file = named_path(text_of(map, "urdf"), *file, map.key("urdf"), source);
  sidecar.name = map.text("name").value_or("");
  if (map.has("hitch")) {
    sidecar.hitch.emplace();
    vector3(map, "hitch", "m", *sidecar.hitch);
  }
  map.need("wheels");
  for (const auto& [key, item] : map.items("wheels")) {
    MapReader m(*item, key, source);
    UrdfWheel w;
    w.link = text_of(m, "link");
    w.has_radius = m.has("radius");
    w.has_width = m.has("width");
    w.has_max_torque = item->at("drive.max_torque") != nullptr;
    w.has_steering_limits = item->at("steering.limit") != nullptr;
    w.has_steering_rate = item->at("steering.rate") != nullptr;
    read_wheel_parts(m, w.spec);
    m.finish();
    if (w.spec.strut)
      source.problem(*item, key + ".strut", "cannot stand in a sidecar", "a prismatic joint of the URDF with a spring");
    sidecar.wheels.push_back(w);
  }
  for (const auto& [key, item] : map.items("springs")) {
    MapReader m(*item, key, source);
    const std::string joint = text_of(m, "joint");
    sidecar.springs[joint] = read_spring(m, m.choice("of", {"hinge", "slider"}).value_or("hinge") == "hinge");
    m.finish();
  }
  for (const auto& [key, item] : map.items("locked"))
    if (const auto name = read_text(*item, key, source)) sidecar.locked.insert(*name);
  for (const auto& [key, item] : map.items("joints")) {
    MapReader m(*item, key, source);
    sidecar.joints.push_back(read_joint(m));
  }
  for (const auto& [key, item] : map.items("sensors")) {
    MapReader m(*item, key, source);
    sidecar.sensors.push_back(read_sensor(m));
  }
  map.finish();
  if (!source.problems.empty()) return {};
  try {
    const UrdfImport in = import_urdf(sidecar);
    for (const std::string& t : in.taken) source.notes.push_back(sidecar.file + ": taken: " + t);
    for (const std::string& t : in.left_out) source.notes.push_back(sidecar.file + ": left out: " + t);
    return in.machine;
  } catch (const InputError& e) {
    for (Problem p : e.problems()) {
      if (p.file.empty()) {
        const Node* at = map.node().at(p.key);
        source.problem(at != nullptr ? *at : map.node(), map.key(p.key), p.message, p.expected);
      } else {
        source.problems.push_back(p);
      }
    }
  }
  return {};
}

}  // namespace

VehicleSpec read_machine(const Node& node, const std::string& key, Source& source) {
  VehicleSpec v;
  const std::size_t before = source.problems.size();
  MapReader map(node, key, source);
  if (map.has("urdf")) {
    v = read_urdf_machine(map);
  } else {
    v.name = text_of(map, "name");
    vector3(map, "hitch", "m", v.hitch);
    for (const auto& [item_key, item] : map.items("bodies")) {
      MapReader m(*item, item_key, source);
      BodySpec b;
      b.name = text_of(m, "name");
      m.need("mass");
      set_if(b.mass, m.number("mass", "kg", above(0)));
      vector3(m, "position", "m", b.position);
      vector3(m, "size", "m", b.size);
      if (m.has("inertia")) {
        Vec3 moments = Vec3::Zero();
        vector3(m, "inertia", "kg m^2", moments);
        b.inertia = Mat3(moments.asDiagonal());
      }
      set_if(b.touches_ground, m.flag("touches_ground"));
      read_pieces(m, b);
      m.finish();
      v.bodies.push_back(b);
    }
    for (const auto& [item_key, item] : map.items("joints")) {
      MapReader m(*item, item_key, source);
      v.joints.push_back(read_joint(m));
    }
    for (const auto& [item_key, item] : map.items("wheels")) {
      MapReader m(*item, item_key, source);
      v.wheels.push_back(read_wheel(m));
    }
    for (const auto& [item_key, item] : map.items("sensors")) {
      MapReader m(*item, item_key, source);
      v.sensors.push_back(read_sensor(m));
    }
    map.finish();
  }
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

MachineFile load_machine(const std::string& path) {
  const Node root = read_yaml(path);
  Source source{path, {}, {}};
  MachineFile out;
  out.machine = read_machine(root, "", source);
  throw_if_any(source.problems);
  out.notes = source.notes;
  return out;
}

VehicleSpec parse_machine(const std::string& text, const std::string& file) {
  const Node root = parse_yaml(text, file);
  Source source{file, {}, {}};
  VehicleSpec out = read_machine(root, "", source);
  throw_if_any(source.problems);
  return out;
}

}  // namespace terrode::scenario
