#include "scenario/machine_file.h"

#include <functional>

#include "scenario/pieces.h"
#include "scenario/section.h"
#include "scenario/urdf_file.h"

namespace terrode::scenario {

namespace {

using namespace vehicle;

const char* const kPreload = "that the spring exerts against the parent as assembled";

Table<SpringSpec> spring_table(bool turns) {
  Table<SpringSpec> t;
  t.number("stiffness", turns ? "N m/rad" : "N/m", at_least(0), &SpringSpec::stiffness, "of the spring")
      .number("damping", turns ? "N m s/rad" : "N s/m", at_least(0), &SpringSpec::damping, "of the damper")
      .number("preload", turns ? "N m" : "N", any_number(), &SpringSpec::preload, kPreload);
  return t;
}

Json either_spring() { return Json::array({spring_table(true).schema(), spring_table(false).schema()}); }

Table<DriveSpec> wheel_drive_table() {
  Table<DcMotorSpec> motor;
  motor.number("voltage", "V", above(0), &DcMotorSpec::voltage, "of the supply, at most")
      .number("resistance", "Ohm", above(0), &DcMotorSpec::resistance, "of the motor")
      .number("torque_constant", "N m/A", above(0), &DcMotorSpec::torque_constant, "of the motor's shaft")
      .number("gear", "-", above(0), &DcMotorSpec::gear, "motor turns per wheel turn")
      .number("efficiency", "-", {0, 1, true, false}, &DcMotorSpec::efficiency, "of the gear")
      .number("current_limit", "A", above(0), &DcMotorSpec::current_limit, "absent: none")
      .number("speed_gain", "V s/rad", at_least(0), &DcMotorSpec::speed_gain, "of the speed controller, of wheel speed");
  Table<DriveSpec> t;
  t.choice<DriveKind>("kind",
                      {{"free", DriveKind::free}, {"speed", DriveKind::speed}, {"torque", DriveKind::torque}, {"dc_motor", DriveKind::dc_motor}},
                      &DriveSpec::kind, "a servo, a torque, a direct-current motor, or nothing")
      .number("max_torque", "N m", above(0), &DriveSpec::max_torque, "absent: unlimited")
      .embed(&DriveSpec::motor, motor);
  return t;
}

// What a wheel is beside its place and mass.
Table<VehicleWheelSpec> wheel_parts_table(bool size_required) {
  using wheel::WheelShape;
  Table<WheelShape> shape;
  shape.number("radius", "m", above(0), &WheelShape::radius, "of the rim without lugs");
  if (size_required) shape.required();
  shape.number("width", "m", above(0), &WheelShape::width, "of the rim");
  if (size_required) shape.required();
  shape.number("crown_radius", "m", at_least(0), &WheelShape::crown_radius, "of the rim's profile across the width; 0: flat")
      .add({"grousers", false, grouser_table().schema(),
            [](MapReader& map, WheelShape& out) {
              WheelSpec lugs;
              if (auto g = map.section("grousers")) {
                grouser_table().read(*g, lugs);
                out.grousers = grousers_of(lugs);
              }
            },
            [](const WheelShape& in) -> std::optional<Node> {
              if (in.grousers.count == 0) return std::nullopt;
              return grouser_table().write(wheel_spec_of(in.grousers));
            }});
  Table<StrutSpec> strut;
  strut.embed(&StrutSpec::spring, spring_table(false)).number("upright_mass", "kg", above(0), &StrutSpec::upright_mass, "of what the strut carries beside the wheel");
  Table<SteeringSpec> steering;
  steering.number("limit", "rad", above(0), &SteeringSpec::limit, "largest angle to either side")
      .number("rate", "rad/s", above(0), &SteeringSpec::rate, "at which it turns, at most")
      .number("response", "s", above(0), &SteeringSpec::response, "of the servo")
      .number("knuckle_mass", "kg", above(0), &SteeringSpec::knuckle_mass, "of what turns beside the wheel")
      .text("joint", &SteeringSpec::joint, "a hinge of the machine that steers, in place of a knuckle");
  Table<VehicleWheelSpec> t;
  t.embed(&VehicleWheelSpec::shape, shape)
      .section("drive", &VehicleWheelSpec::drive, wheel_drive_table(), "of the axle")
      .section("strut", &VehicleWheelSpec::strut, strut, "spring and damper between parent and wheel, vertical")
      .section("steering", &VehicleWheelSpec::steering, steering, "about the vertical");
  return t;
}

// Principal moments along the machine's axes.
template <class T>
void add_inertia(Table<T>& t, std::optional<Mat3> T::*member) {
  t.add({"inertia", false,
         {{"type", "array"},
          {"description", "about the centre of mass, along x, y, z"},
          {"items", quantity_schema("kg m^2", above(0), "")},
          {"minItems", 3},
          {"maxItems", 3}},
         [=](MapReader& map, T& out) {
           if (const auto moments = read_vector(map, "inertia", "kg m^2")) out.*member = Mat3(moments->asDiagonal());
         },
         [=](const T& in) -> std::optional<Node> {
           if (!(in.*member)) return std::nullopt;
           Node list = Node::sequence();
           for (int i = 0; i < 3; ++i) list.items.push_back(quantity_node((*(in.*member))(i, i), "kg m^2"));
           return list;
         }});
}

Table<BodySpec> body_table() {
  Table<BodySpec> t;
  t.text("name", &BodySpec::name, "by which joints and wheels know it")
      .required()
      .number("mass", "kg", above(0), &BodySpec::mass, "of the body")
      .required()
      .vector("position", "m", any_number(), &BodySpec::position, "of the centre of mass: x, y, z")
      .vector("size", "m", any_number(), &BodySpec::size, "of the box that gives inertia and touches rocks: x, y, z");
  add_inertia(t, &BodySpec::inertia);
  Table<BodySpec>::Key pieces = pieces_key("pieces", &BodySpec::pieces, "points about the centre of mass whose convex hulls press on the soil in place of the box");
  pieces.read = [read = pieces.read](MapReader& map, BodySpec& out) {
    read(map, out);
    out.touches_ground = out.touches_ground || !out.pieces.empty();
  };
  t.flag("touches_ground", &BodySpec::touches_ground, "whether its box presses on the soil").add(std::move(pieces));
  return t;
}

Table<VehicleWheelSpec> wheel_table_of_machine() {
  Table<VehicleWheelSpec> t;
  t.text("name", &VehicleWheelSpec::name, "by which results know it")
      .required()
      .text("parent", &VehicleWheelSpec::parent, "the body that carries it")
      .required()
      .vector("centre", "m", any_number(), &VehicleWheelSpec::centre, "of the wheel: x, y, z")
      .required()
      .number("mass", "kg", above(0), &VehicleWheelSpec::mass, "of the wheel")
      .required();
  add_inertia(t, &VehicleWheelSpec::inertia);
  const Table<VehicleWheelSpec> parts = wheel_parts_table(true);
  for (const auto& key : parts.keys()) t.add(key);
  return t;
}

Table<SensorSpec> sensor_table() {
  Table<SensorSpec> t;
  t.text("name", &SensorSpec::name, "of its channels")
      .required()
      .choice<SensorKind>("kind", {{"imu", SensorKind::imu}, {"encoder", SensorKind::encoder}, {"joint_load", SensorKind::joint_load}},
                          &SensorSpec::kind, "acceleration less gravity and angular velocity; position and rate; force and moment")
      .required()
      .text("body", &SensorSpec::body, "that carries an imu")
      .vector("position", "m", any_number(), &SensorSpec::position, "of an imu: x, y, z")
      .text("joint", &SensorSpec::joint, "of an encoder or a load; those of a wheel are WHEEL.axle, .steering, .strut")
      .number("noise", "", at_least(0), &SensorSpec::noise, "deviation of a normal error, in the channel's unit");
  return t;
}

// A sensor's keys that go with its kind.
void check_sensor(const Node& item, const std::string& key, const SensorSpec& s, Source& source) {
  const bool imu = s.kind == SensorKind::imu;
  if ((imu ? s.body : s.joint).empty()) source.problem(item, key + (imu ? ".body" : ".joint"), "is missing");
  for (const char* other : {"body", "position", "joint"})
    if (item.find(other) != nullptr && imu == (std::string(other) == "joint"))
      source.problem(*item.find(other), key + "." + other, "does not go with this kind of sensor", imu ? "body, position" : "joint");
}

Table<JointSpec> joint_table() {
  Table<JointSpec> t;
  t.text("name", &JointSpec::name, "of the joint")
      .required()
      .choice<JointKind>("kind",
                         {{"fixed", JointKind::fixed},
                          {"hinge", JointKind::hinge},
                          {"slider", JointKind::slider},
                          {"ball", JointKind::ball},
                          {"rod", JointKind::rod}},
                         &JointSpec::kind, "how body and parent are held together")
      .required()
      .text("body", &JointSpec::body, "one of the two")
      .required()
      .text("parent", &JointSpec::parent, "the other")
      .required()
      .vector("anchor", "m", any_number(), &JointSpec::anchor, "of the joint, on the body: x, y, z")
      .vector("anchor_on_parent", "m", any_number(), &JointSpec::anchor_on_parent, "of a rod's other end: x, y, z")
      .vector("axis", "-", any_number(), &JointSpec::axis, "of a hinge or slider: x, y, z")
      .add({"spring", false, {{"description", "of a hinge or a slider, about its place as assembled"}, {"anyOf", either_spring()}},
            [](MapReader& map, JointSpec& out) {
              if (auto below = map.section("spring")) spring_table(out.kind == JointKind::hinge).read(*below, out.spring.emplace());
            },
            [](const JointSpec& in) -> std::optional<Node> {
              if (!in.spring) return std::nullopt;
              return spring_table(in.kind == JointKind::hinge).write(*in.spring);
            }});
  return t;
}

Table<VehicleSpec> machine_table() {
  Table<VehicleSpec> t;
  t.text("name", &VehicleSpec::name, "of the machine")
      .required()
      .vector("hitch", "m", any_number(), &VehicleSpec::hitch, "where a drawbar load pulls at the first body: x, y, z")
      .list("bodies", &VehicleSpec::bodies, body_table(), "rigid bodies; the first one's motion is the machine's")
      .list("joints", &VehicleSpec::joints, joint_table(), "between bodies")
      .list("wheels", &VehicleSpec::wheels, wheel_table_of_machine(), "with their drives")
      .list("sensors", &VehicleSpec::sensors, sensor_table(), "whose channels are recorded");
  return t;
}

Table<UrdfWheel> urdf_wheel_table() {
  Table<UrdfWheel> t;
  t.text("link", &UrdfWheel::link, "of the URDF that is a wheel").required().embed(&UrdfWheel::spec, wheel_parts_table(false));
  return t;
}

// A sidecar's spring: its joint, what that is, and the spring by what it is.
struct UrdfSpring {
  std::string joint, of = "hinge";
  SpringSpec spring;
};

Table<UrdfSpring> urdf_spring_table() {
  Table<UrdfSpring> t;
  t.text("joint", &UrdfSpring::joint, "of the URDF").required().choice("of", {"hinge", "slider"}, &UrdfSpring::of, "what the joint is");
  const Table<SpringSpec> spring = spring_table(false);
  for (const auto& key : spring.keys())
    t.add({key.name, false, {{"description", "in N/m, N s/m, N of a slider; in N m/rad, N m s/rad, N m of a hinge"}},
           [name = key.name](MapReader& map, UrdfSpring& out) {
             const Table<SpringSpec> by_kind = spring_table(out.of == "hinge");
             for (const auto& k : by_kind.keys())
               if (k.name == name) k.read(map, out.spring);
           },
           [name = key.name](const UrdfSpring& in) -> std::optional<Node> {
             const Table<SpringSpec> by_kind = spring_table(in.of == "hinge");
             for (const auto& k : by_kind.keys())
               if (k.name == name) return k.write(in.spring);
             return std::nullopt;
           }});
  return t;
}

// Reads each item of a list, and has it checked with its node.
template <class S>
std::vector<S> read_list(MapReader& map, const std::string& name, const Table<S>& table,
                         const std::function<void(const Node&, const std::string&, S&)>& check = {}) {
  std::vector<S> out;
  for (const auto& [key, item] : map.items(name)) {
    MapReader below(*item, key, map.source());
    table.read(below, out.emplace_back());
    if (check) check(*item, key, out.back());
  }
  return out;
}

// A machine from URDF, with what the sidecar says beside it.
VehicleSpec read_urdf_machine(MapReader& map) {
  Source& source = map.source();
  UrdfSidecar sidecar;
  if (const Node* file = map.need("urdf")) sidecar.file = named_path(map.text("urdf").value_or(""), *file, map.key("urdf"), source);
  sidecar.name = map.text("name").value_or("");
  if (map.has("hitch")) sidecar.hitch = read_vector(map, "hitch", "m");
  map.need("wheels");
  sidecar.wheels = read_list<UrdfWheel>(map, "wheels", urdf_wheel_table(), [&](const Node& item, const std::string& key, UrdfWheel& w) {
    w.has_radius = item.find("radius") != nullptr;
    w.has_width = item.find("width") != nullptr;
    w.has_max_torque = item.at("drive.max_torque") != nullptr;
    w.has_steering_limits = item.at("steering.limit") != nullptr;
    w.has_steering_rate = item.at("steering.rate") != nullptr;
    if (w.spec.strut) source.problem(item, key + ".strut", "cannot stand in a sidecar", "a prismatic joint of the URDF with a spring");
  });
  for (const UrdfSpring& s : read_list(map, "springs", urdf_spring_table())) sidecar.springs[s.joint] = s.spring;
  for (const auto& [key, item] : map.items("locked"))
    if (const auto name = read_text(*item, key, source)) sidecar.locked.insert(*name);
  sidecar.joints = read_list(map, "joints", joint_table());
  sidecar.sensors = read_list<SensorSpec>(map, "sensors", sensor_table(), [&](const Node& item, const std::string& key, SensorSpec& s) {
    check_sensor(item, key, s, source);
  });
  map.finish();
  if (!source.problems.empty()) return {};
  try {
    const UrdfImport in = import_urdf(sidecar);
    for (const std::string& t : in.taken) source.notes.push_back(sidecar.file + ": taken: " + t);
    for (const std::string& t : in.left_out) source.notes.push_back(sidecar.file + ": left out: " + t);
    return in.machine;
  } catch (const InputError& e) {
    for (const Problem& p : e.problems()) {
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
    machine_table().read(map, v);
    for (std::size_t i = 0; i < v.sensors.size(); ++i)
      if (const Node* item = node.at("sensors[" + std::to_string(i) + "]"))
        check_sensor(*item, map.key("sensors[" + std::to_string(i) + "]"), v.sensors[i], source);
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

Json machine_schema() {
  const Json urdf = {{"type", "object"},
                     {"additionalProperties", false},
                     {"required", {"urdf", "wheels"}},
                     {"properties",
                      {{"urdf", {{"type", "string"}, {"description", "path of the URDF"}}},
                       {"name", {{"type", "string"}}},
                       {"hitch", {{"type", "array"}, {"items", quantity_schema("m", any_number(), "")}, {"minItems", 3}, {"maxItems", 3}}},
                       {"wheels", {{"type", "array"}, {"items", urdf_wheel_table().schema()}}},
                       {"springs", {{"type", "array"}, {"items", urdf_spring_table().schema()}}},
                       {"locked", {{"type", "array"}, {"items", {{"type", "string"}}}, {"description", "joints held at zero"}}},
                       {"joints", {{"type", "array"}, {"items", joint_table().schema()}, {"description", "further ones, which close loops"}}},
                       {"sensors", {{"type", "array"}, {"items", sensor_table().schema()}}}}}};
  Json out = Json::object();
  out["anyOf"] = Json::array({machine_table().schema(), urdf});
  return out;
}

std::string to_yaml(const VehicleSpec& machine) { return to_yaml(machine_table().write(machine)); }

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
