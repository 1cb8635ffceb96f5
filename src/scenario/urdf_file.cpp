#include "scenario/urdf_file.h"

#include <console_bridge/console.h>
#include <fmt/format.h>
#include <urdf_parser/urdf_parser.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>
#include <mutex>

#include "core/utf8.h"
#include "scenario/reader.h"

namespace terrode::scenario {

namespace {

using namespace vehicle;

Vec3 vec(const urdf::Vector3& v) { return {v.x, v.y, v.z}; }
Quat quat(const urdf::Rotation& r) { return Quat(r.w, r.x, r.y, r.z).normalized(); }

// A place and orientation in the root link's frame.
struct Placed {
  Vec3 p = Vec3::Zero();
  Quat q = Quat::Identity();
  Placed then(const urdf::Pose& next) const { return {p + q * vec(next.position), q * quat(next.rotation)}; }
};

// The parser speaks through a process-wide log: what it says is gathered here.
class Listener final : public console_bridge::OutputHandler {
 public:
  Listener() { console_bridge::useOutputHandler(this); }
  ~Listener() override { console_bridge::restorePreviousOutputHandler(); }
  void log(const std::string& text, console_bridge::LogLevel level, const char*, int) override {
    if (level >= console_bridge::CONSOLE_BRIDGE_LOG_ERROR) errors.push_back(text);
    else if (level == console_bridge::CONSOLE_BRIDGE_LOG_WARN) warnings.push_back(text);
  }
  std::vector<std::string> errors, warnings;
};

std::mutex& parser_mutex() {
  static std::mutex mutex;
  return mutex;
}

// Names become part of channel and file paths.
std::string plain(const std::string& name) {
  std::string out;
  for (const char c : name) out += std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '-' ? c : '_';
  return out;
}

// Links that move as one body.
struct Group {
  std::string name;
  double mass = 0.0;
  Vec3 first = Vec3::Zero();      // sum of mass times position
  Mat3 about_root = Mat3::Zero(); // inertia about the root frame's origin
  std::optional<Vec3> size;       // of a collision box
  std::vector<std::string> links;

  Vec3 centre() const { return first / mass; }
  Mat3 inertia() const {
    const Vec3 c = centre();
    return about_root - mass * (c.squaredNorm() * Mat3::Identity() - c * c.transpose());
  }
  void add(double m, const Vec3& at, const Mat3& own) {
    mass += m;
    first += m * at;
    about_root += own + m * (at.squaredNorm() * Mat3::Identity() - at * at.transpose());
  }
};

// Edges of the solid box that has these moments; what cannot be is cut to a centimetre.
Vec3 box_of(double mass, const Mat3& inertia) {
  constexpr double thinnest = 0.01;  // m
  Vec3 out;
  for (int i = 0; i < 3; ++i) {
    const double s = 6.0 / mass * (inertia.trace() - 2.0 * inertia(i, i));
    out[i] = std::max(thinnest, s > 0.0 ? std::sqrt(s) : 0.0);
  }
  return out;
}

const char* kind_name(int type) {
  switch (type) {
    case urdf::Joint::REVOLUTE: return "revolute";
    case urdf::Joint::CONTINUOUS: return "continuous";
    case urdf::Joint::PRISMATIC: return "prismatic";
    case urdf::Joint::FLOATING: return "floating";
    case urdf::Joint::PLANAR: return "planar";
    case urdf::Joint::FIXED: return "fixed";
    default: return "unknown";
  }
}

class Importer {
 public:
  explicit Importer(const UrdfSidecar& sidecar) : sidecar_(sidecar) {}

  UrdfImport run() {
    parse();
    index_sidecar();
    walk(*model_->getRoot(), {}, start_group(*model_->getRoot(), {}));
    check_sidecar();
    throw_if_any(problems_);
    build();
    throw_if_any(problems_);
    return std::move(out_);
  }

 private:
  void wrong(const std::string& key, const std::string& message, const std::string& expected) {
    problems_.push_back({{}, 0, 0, key, message, expected});
  }
  void wrong_file(const std::string& key, const std::string& message, const std::string& expected) {
    problems_.push_back({sidecar_.file, 0, 0, key, message, expected});
  }

  void parse() {
    constexpr std::size_t largest = 16u << 20;
    text_ = read_text_file(sidecar_.file, largest);
    // TinyXML, by which urdfdom reads, looks beyond the end of a text that breaks off within a character.
    if (const std::size_t bad = find_invalid_utf8(text_); bad != std::string::npos)
      throw InputError({sidecar_.file, line_of(text_, bad), 0, "robot", "is not UTF-8 text", "a URDF file in UTF-8 (save it as UTF-8)"});
    const std::lock_guard<std::mutex> lock(parser_mutex());
    Listener listener;
    model_ = urdf::parseURDF(text_);
    if (model_ == nullptr || model_->getRoot() == nullptr) {
      std::string said;
      for (const std::string& e : listener.errors) said += (said.empty() ? "" : "; ") + e;
      throw InputError({sidecar_.file, 0, 0, "robot", said.empty() ? "cannot be read as URDF" : "cannot be read: " + said,
                        "a URDF file with one root link"});
    }
    for (const std::string& w : listener.warnings) left_out(w);
  }

  void index_sidecar() {
    for (const UrdfWheel& w : sidecar_.wheels) wheels_[w.link] = &w;
  }

  void taken(const std::string& text) { out_.taken.push_back(text); }
  void left_out(const std::string& text) { out_.left_out.push_back(text); }

  std::size_t start_group(const urdf::Link& link, const Placed&) {
    groups_.push_back({});
    groups_.back().name = plain(link.name);
    return groups_.size() - 1;
  }

  void walk(const urdf::Link& link, const Placed& at, std::size_t group) {
    Group& g = groups_[group];
    g.links.push_back(link.name);
    group_of_[link.name] = group;
    placed_[link.name] = at;
    if (link.inertial != nullptr) {
      const Placed own = at.then(link.inertial->origin);
      Mat3 inertia;
      const urdf::Inertial& i = *link.inertial;
      inertia << i.ixx, i.ixy, i.ixz, i.ixy, i.iyy, i.iyz, i.ixz, i.iyz, i.izz;
      const Mat3 R = own.q.toRotationMatrix();
      if (!(i.mass >= 0.0) || !inertia.allFinite())
        wrong_file("link." + link.name + ".inertial", "is not a mass with moments", "numbers, the mass 0 or more");
      else
        g.add(i.mass, own.p, R * inertia * R.transpose());
    }
    if (!wheels_.contains(link.name)) {
      if (link.collision != nullptr && link.collision->geometry != nullptr) {
        if (link.collision->geometry->type == urdf::Geometry::BOX && !g.size)
          g.size = vec(std::dynamic_pointer_cast<urdf::Box>(link.collision->geometry)->dim);
        else if (link.collision->geometry->type == urdf::Geometry::MESH)
          left_out(fmt::format("link '{}': its collision mesh; a box that has its inertia touches rocks in its place", link.name));
      }
      if (link.collision_array.size() > 1)
        left_out(fmt::format("link '{}': {} of its collision shapes", link.name, link.collision_array.size() - 1));
    }
    if (!link.visual_array.empty()) ++visuals_;
    for (const urdf::JointSharedPtr& j : link.child_joints) {
      const urdf::LinkConstSharedPtr child = model_->getLink(j->child_link_name);
      if (child == nullptr) continue;
      const Placed below = at.then(j->parent_to_joint_origin_transform);
      joints_seen_.insert(j->name);
      bool joined = j->type == urdf::Joint::FIXED || sidecar_.locked.contains(j->name);
      if (j->type == urdf::Joint::FLOATING || j->type == urdf::Joint::PLANAR || j->type == urdf::Joint::UNKNOWN) {
        wrong_file("joint." + j->name + ".type", fmt::format("is {}", kind_name(j->type)),
                   "fixed, continuous, revolute or prismatic, or the joint among `locked` of the sidecar");
        joined = true;
      }
      if (joined) {
        walk(*child, below, group);
        if (j->type != urdf::Joint::FIXED) taken(fmt::format("joint '{}' ({}): locked at zero", j->name, kind_name(j->type)));
        continue;
      }
      const std::size_t next = start_group(*child, below);
      movable_.push_back({j, below, group, next});
      walk(*child, below, next);
    }
  }

  void check_sidecar() {
    const auto known = [&](const std::string& key, const std::string& name, const std::vector<std::string>& names, const char* what) {
      if (std::find(names.begin(), names.end(), name) != names.end()) return;
      const std::string near = nearest_word(name, names);
      wrong(key, fmt::format("'{}' is not a {} of {}", name, what, sidecar_.file), near.empty() ? fmt::format("the name of a {}", what) : "'" + near + "'");
    };
    std::vector<std::string> links, joints(joints_seen_.begin(), joints_seen_.end());
    for (const auto& [name, p] : placed_) links.push_back(name);
    for (std::size_t i = 0; i < sidecar_.wheels.size(); ++i)
      known(fmt::format("wheels[{}].link", i), sidecar_.wheels[i].link, links, "link");
    for (const auto& [name, s] : sidecar_.springs) known("springs", name, joints, "joint");
    for (const std::string& name : sidecar_.locked) known("locked", name, joints, "joint");
    if (sidecar_.wheels.empty()) wrong("wheels", "is empty", "at least one link that is a wheel");
  }

  void build() {
    VehicleSpec& v = out_.machine;
    v.name = sidecar_.name.empty() ? plain(model_->getName()) : sidecar_.name;
    // Wheels first: which groups they are, and what radius they stand on.
    std::map<std::size_t, const UrdfWheel*> wheel_groups;
    double lowest = std::numeric_limits<double>::infinity();
    std::vector<VehicleWheelSpec> specs;
    for (std::size_t i = 0; i < sidecar_.wheels.size(); ++i) {
      const UrdfWheel& w = sidecar_.wheels[i];
      const std::string key = fmt::format("wheels[{}]", i);
      VehicleWheelSpec s = w.spec;
      const std::size_t group = group_of_.at(w.link);
      s.name = plain(w.link);
      const auto axle = std::find_if(movable_.begin(), movable_.end(), [&](const Movable& m) { return m.child == group; });
      if (axle == movable_.end() || (axle->joint->type != urdf::Joint::CONTINUOUS && axle->joint->type != urdf::Joint::REVOLUTE)) {
        wrong(key + ".link", "'" + w.link + "' does not turn", "a link at the end of a continuous or revolute joint");
        continue;
      }
      if (!wheel_groups.emplace(group, &w).second) wrong(key + ".link", "is part of another wheel", "one wheel a body");
      const Vec3 axis = axle->at.q * vec(axle->joint->axis).normalized();
      constexpr double straight = 1e-3;  // sine of the axle's angle to the machine's y
      if (std::hypot(axis.x(), axis.z()) > straight) {
        wrong_file("joint." + axle->joint->name + ".axis",
                   fmt::format("is ({:.4g}, {:.4g}, {:.4g}) in the machine", axis.x(), axis.y(), axis.z()),
                   "along y: wheels with camber or toe are not taken");
        continue;
      }
      if (axis.y() < 0.0)
        left_out(fmt::format("joint '{}': its sense; wheels turn about +y, which drives forward", axle->joint->name));
      s.centre = axle->at.p;
      const double aside = (groups_[group].mass > 0.0 ? (groups_[group].centre() - s.centre).norm() : 0.0);
      constexpr double rounding = 1e-6;  // m
      if (aside > rounding)
        left_out(fmt::format("link '{}': its centre of mass lies {:.3g} mm off the axle; taken on it", w.link, 1e3 * aside));
      rim_of(w, s, key);
      if (groups_[group].mass > 0.0) {
        s.mass = groups_[group].mass;
        s.inertia = groups_[group].inertia();
      } else {
        wrong_file("link." + w.link + ".inertial", "is missing or has no mass", "a mass above 0");
      }
      if (!w.has_max_torque && axle->joint->limits != nullptr && axle->joint->limits->effort > 0.0)
        s.drive.max_torque = axle->joint->limits->effort;
      if (axle->joint->limits != nullptr && axle->joint->limits->velocity > 0.0)
        left_out(fmt::format("joint '{}': its largest velocity {:.4g} rad/s", axle->joint->name, axle->joint->limits->velocity));
      axles_.insert(axle->joint->name);
      dynamics(*axle->joint);
      lowest = std::min(lowest, s.centre.z() - s.shape.radius);
      s.parent = groups_[axle->parent].name;
      specs.push_back(s);
    }
    if (!problems_.empty()) return;
    const Vec3 down(0.0, 0.0, lowest);

    for (std::size_t g = 0; g < groups_.size(); ++g) {
      if (wheel_groups.contains(g)) continue;
      const Group& group = groups_[g];
      if (!(group.mass > 0.0)) {
        wrong_file("link." + group.links.front() + ".inertial", "is missing or has no mass",
                   "a mass above 0 for what moves by itself, or its joint among `locked`");
        continue;
      }
      BodySpec b;
      b.name = group.name;
      b.mass = group.mass;
      b.position = group.centre() - down;
      b.inertia = group.inertia();
      b.size = group.size.value_or(box_of(b.mass, *b.inertia));
      v.bodies.push_back(b);
      std::string others;
      for (std::size_t i = 1; i < group.links.size(); ++i) others += (i == 1 ? " with " : ", ") + group.links[i];
      taken(fmt::format("link '{}'{}: a body of {:.4g} kg", group.links.front(), others, b.mass));
    }
    for (const Movable& m : movable_) {
      if (axles_.contains(m.joint->name)) continue;
      JointSpec j;
      j.name = plain(m.joint->name);
      j.kind = m.joint->type == urdf::Joint::PRISMATIC ? JointKind::slider : JointKind::hinge;
      j.body = groups_[m.child].name;
      j.parent = groups_[m.parent].name;
      j.anchor = m.at.p - down;
      j.axis = m.at.q * vec(m.joint->axis);
      const auto spring = sidecar_.springs.find(m.joint->name);
      const auto steered = std::find_if(sidecar_.wheels.begin(), sidecar_.wheels.end(), [&](const UrdfWheel& w) {
        return w.spec.steering && w.spec.steering->joint == m.joint->name;
      });
      if (spring != sidecar_.springs.end())
        j.spring = spring->second;
      else if (m.joint->dynamics != nullptr && m.joint->dynamics->damping > 0.0 && steered == sidecar_.wheels.end())
        j.spring = SpringSpec{0.0, m.joint->dynamics->damping, 0.0};
      taken(fmt::format("joint '{}' ({}): a {}{}", m.joint->name, kind_name(m.joint->type),
                        j.kind == JointKind::slider ? "slider" : "hinge",
                        steered != sidecar_.wheels.end() ? " that steers" : j.spring ? " with spring or damper" : ", free"));
      if (steered == sidecar_.wheels.end()) {
        if (m.joint->type != urdf::Joint::CONTINUOUS && m.joint->limits != nullptr && m.joint->limits->upper > m.joint->limits->lower)
          left_out(fmt::format("joint '{}': its stops at {:.4g} and {:.4g}", m.joint->name, m.joint->limits->lower, m.joint->limits->upper));
        dynamics(*m.joint);
      }
      if (m.joint->mimic != nullptr)
        left_out(fmt::format("joint '{}': that it mimics '{}' (close the loop by `joints` of the sidecar)", m.joint->name,
                             m.joint->mimic->joint_name));
      v.joints.push_back(j);
    }
    for (VehicleWheelSpec& s : specs) {
      s.centre -= down;
      const UrdfWheel& w = *std::find_if(sidecar_.wheels.begin(), sidecar_.wheels.end(),
                                         [&](const UrdfWheel& x) { return plain(x.link) == s.name; });
      if (s.steering) steer(w, s);
      taken(fmt::format("link '{}': a wheel of radius {:.4g} m and width {:.4g} m, {:.4g} kg{}", w.link, s.shape.radius, s.shape.width,
                        s.mass, s.steering ? ", steered" : ""));
      v.wheels.push_back(s);
    }
    for (const JointSpec& j : sidecar_.joints) v.joints.push_back(j);
    v.sensors = sidecar_.sensors;
    v.hitch = sidecar_.hitch.value_or(v.bodies.empty() ? Vec3::Zero() : v.bodies.front().position);
    if (visuals_ > 0) left_out(fmt::format("the visual shapes and materials of {} links", visuals_));
    for (const char* tag : {"transmission", "gazebo", "sensor", "ros2_control"}) {
      std::size_t count = 0;
      const std::string open = std::string("<") + tag;
      for (std::size_t at = text_.find(open); at != std::string::npos; at = text_.find(open, at + 1))
        count += text_[at + open.size()] == ' ' || text_[at + open.size()] == '>' ? 1 : 0;
      if (count > 0) left_out(fmt::format("{} element{} <{}>", count, count > 1 ? "s" : "", tag));
    }
  }

  // Radius and width: of the sidecar, else of a cylinder (or ball) among the link's shapes.
  void rim_of(const UrdfWheel& w, VehicleWheelSpec& s, const std::string& key) {
    if (w.has_radius && w.has_width) return;
    const urdf::LinkConstSharedPtr link = model_->getLink(w.link);
    for (const urdf::GeometrySharedPtr& g :
         {link->collision != nullptr ? link->collision->geometry : nullptr, link->visual != nullptr ? link->visual->geometry : nullptr}) {
      if (g == nullptr) continue;
      if (g->type == urdf::Geometry::CYLINDER) {
        const auto c = std::dynamic_pointer_cast<urdf::Cylinder>(g);
        if (!w.has_radius) s.shape.radius = c->radius;
        if (!w.has_width) s.shape.width = c->length;
        return;
      }
      if (g->type == urdf::Geometry::SPHERE && w.has_width) {
        s.shape.radius = std::dynamic_pointer_cast<urdf::Sphere>(g)->radius;
        return;
      }
    }
    wrong(key, "has no " + std::string(w.has_radius ? "width" : w.has_width ? "radius" : "radius and width") +
                   ", and link '" + w.link + "' no cylinder to take it from",
          "radius and width of the wheel");
  }

  void dynamics(const urdf::Joint& j) {
    if (j.dynamics == nullptr) return;
    if (j.dynamics->friction > 0.0) left_out(fmt::format("joint '{}': its friction {:.4g}", j.name, j.dynamics->friction));
    if (j.dynamics->damping > 0.0 && axles_.contains(j.name))
      left_out(fmt::format("joint '{}': its damping {:.4g}", j.name, j.dynamics->damping));
  }

  void steer(const UrdfWheel& w, VehicleWheelSpec& s) {
    const auto m = std::find_if(movable_.begin(), movable_.end(), [&](const Movable& x) { return x.joint->name == s.steering->joint; });
    const std::string key = "wheels";
    if (m == movable_.end() || groups_[m->child].name != s.parent) {
      wrong(key, fmt::format("{}: steering.joint '{}' does not hold this wheel", w.link, s.steering->joint),
            "the joint between the wheel's parent link and the body");
      return;
    }
    const Vec3 axis = m->at.q * vec(m->joint->axis).normalized();
    constexpr double upright = 1e-3;
    if (axis.z() < 1.0 - upright) {
      wrong(key, fmt::format("{}: steering.joint '{}' turns about ({:.4g}, {:.4g}, {:.4g})", w.link, s.steering->joint, axis.x(), axis.y(), axis.z()),
            "an axis along +z");
      return;
    }
    if (const auto& l = m->joint->limits; l != nullptr) {
      if (!w.has_steering_limits && l->upper > 0.0 && l->lower < 0.0) s.steering->limit = std::min({l->upper, -l->lower, M_PI});
      if (!w.has_steering_rate && l->velocity > 0.0) s.steering->rate = l->velocity;
      if (l->effort > 0.0) left_out(fmt::format("joint '{}': its largest effort {:.4g}; the steering servo holds its angle", m->joint->name, l->effort));
    }
    s.steering->joint = plain(s.steering->joint);
  }

  struct Movable {
    urdf::JointSharedPtr joint;
    Placed at;
    std::size_t parent, child;
  };

  const UrdfSidecar& sidecar_;
  std::string text_;
  urdf::ModelInterfaceSharedPtr model_;
  std::vector<Group> groups_;
  std::map<std::string, std::size_t> group_of_;
  std::map<std::string, Placed> placed_;
  std::vector<Movable> movable_;
  std::map<std::string, const UrdfWheel*> wheels_;
  std::set<std::string> joints_seen_, axles_;
  std::size_t visuals_ = 0;
  Problems problems_;
  UrdfImport out_;
};

}  // namespace

UrdfImport import_urdf(const UrdfSidecar& sidecar) { return Importer(sidecar).run(); }

}  // namespace terrode::scenario
