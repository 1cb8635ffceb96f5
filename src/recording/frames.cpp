#include "recording/frames.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/version.h"

namespace terrode::recording {
namespace {

constexpr const char* kFrames = "/frames";
constexpr const char* kParticles = "/particles/soil";
constexpr int kCompression = 4;

const char* shape_name(FrameBody::Shape shape) {
  switch (shape) {
    case FrameBody::Shape::box: return "box";
    case FrameBody::Shape::sphere: return "sphere";
    default: return "wheel";
  }
}

std::string body_group(const FrameBody& body) { return fmt::format("{}/bodies/{}", kFrames, body.name); }

void add(Problems& problems, const std::string& key, const std::string& message, const std::string& expected) {
  problems.push_back({{}, 0, 0, key, message, expected});
}

template <typename T>
bool all_finite(const std::vector<T>& values) {
  return std::all_of(values.begin(), values.end(), [](T v) { return std::isfinite(v); });
}

// An array that grows by one row of the given shape a frame, with unit and meaning.
void lay_out(Hdf5File& file, const std::string& path, std::vector<std::size_t> row, const char* unit, const char* meaning,
             bool as_double = false) {
  row.insert(row.begin(), 0);
  ArrayOptions options;
  options.extendible = true;
  options.chunk_rows = row.size() == 1 ? 256 : row.size() == 2 && row[1] <= 4 ? 256 : 1;
  options.compression = options.chunk_rows == 1 ? kCompression : 0;
  if (as_double)
    file.write_grid(path, std::vector<double>{}, row, options);
  else
    file.write_grid(path, std::vector<float>{}, row, options);
  file.set_attribute(path, "unit", unit);
  file.set_attribute(path, "description", meaning);
}

std::vector<float> floats(const Vec3& v) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
}

Vec3 vec(const std::vector<float>& v) { return {v.at(0), v.at(1), v.at(2)}; }

[[noreturn]] void malformed(const Hdf5File& file, const std::string& where, const std::string& message) {
  throw InputError({file.path(), 0, 0, where, message, "frames as docs/formats-frames.md describes them"});
}

double number(const Hdf5File& file, const std::string& path, const char* name) {
  const auto value = file.number_attribute(path, name);
  if (!value || !std::isfinite(*value)) malformed(file, path, fmt::format("has no attribute '{}'", name));
  return *value;
}

}  // namespace

Problems FrameLayout::validate() const {
  Problems problems;
  if (bodies.empty() && !ground && !particles) add(problems, "frames", "show nothing", "a body, ground or particles");
  std::vector<std::string> names;
  for (const FrameBody& b : bodies) {
    const std::string key = "bodies." + b.name;
    const bool plain = !b.name.empty() && std::all_of(b.name.begin(), b.name.end(), [](char c) {
      return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
    });
    if (!plain) add(problems, key, "is no name for a group", "letters, digits, '_' and '-'");
    if (std::find(names.begin(), names.end(), b.name) != names.end()) add(problems, key, "is there twice", "different names");
    names.push_back(b.name);
    if (b.shape != FrameBody::Shape::box) require(problems, key + ".radius", b.radius, "m", b.radius > 0, "above 0");
    if (b.shape == FrameBody::Shape::wheel) require(problems, key + ".width", b.width, "m", b.width > 0, "above 0");
    if (b.shape == FrameBody::Shape::box)
      require(problems, key + ".size", b.size.minCoeff(), "m", b.size.minCoeff() > 0, "above 0");
    if (b.grouser_count < 0) add(problems, key + ".grouser_count", fmt::format("is {}", b.grouser_count), "0 or more");
  }
  if (ground) {
    require(problems, "ground.spacing", ground->spacing, "m", ground->spacing > 0, "above 0");
    if (ground->columns < 2 || ground->rows < 2)
      add(problems, "ground", fmt::format("has {} x {} nodes", ground->columns, ground->rows), "at least 2 x 2");
    if (ground->undisturbed.size() != ground->columns * ground->rows || !all_finite(ground->undisturbed))
      add(problems, "ground.undisturbed", fmt::format("has {} values", ground->undisturbed.size()),
          fmt::format("{} finite heights", ground->columns * ground->rows));
  }
  if (particles) {
    if (particles->radius.empty()) add(problems, "particles", "are none", "at least one");
    for (float r : particles->radius)
      if (!std::isfinite(r) || r <= 0.0f) {
        add(problems, "particles.radius", fmt::format("is {} m", r), "above 0");
        break;
      }
  }
  return problems;
}

FrameWriter::FrameWriter(Hdf5File& file, FrameLayout layout) : file_(&file), layout_(std::move(layout)) {
  throw_if_any(layout_.validate());
  file.create_group(kFrames);
  file.set_attribute(kFrames, "layout", "frames/1");
  const std::string root = kFrames;
  lay_out(file, root + "/time", {}, "s", "time of each frame from the start of the run", true);
  if (!layout_.bodies.empty()) file.create_group(root + "/bodies");
  for (std::size_t i = 0; i < layout_.bodies.size(); ++i) {
    const FrameBody& b = layout_.bodies[i];
    const std::string group = body_group(b);
    file.create_group(group);
    file.set_attribute(group, "index", static_cast<int>(i));
    file.set_attribute(group, "shape", shape_name(b.shape));
    if (b.shape != FrameBody::Shape::box) file.set_attribute(group, "radius", b.radius);
    if (b.shape == FrameBody::Shape::wheel) {
      file.set_attribute(group, "width", b.width);
      file.set_attribute(group, "grouser_count", b.grouser_count);
      file.set_attribute(group, "grouser_height", b.grouser_height);
      file.set_attribute(group, "grouser_thickness", b.grouser_thickness);
    }
    if (b.shape == FrameBody::Shape::box) file.set_attribute(group, "size", std::vector<double>{b.size.x(), b.size.y(), b.size.z()});
    lay_out(file, group + "/position", {3}, "m", "x y z of the body's origin in the world");
    lay_out(file, group + "/orientation", {4}, "", "quaternion w x y z that takes body axes to world axes");
    lay_out(file, group + "/force", {3}, "N", "of the soil on the body, world axes");
    lay_out(file, group + "/moment", {3}, "N m", "of the soil about the body's origin, world axes");
  }
  if (layout_.ground) {
    const FrameGround& g = *layout_.ground;
    const std::string group = root + "/ground";
    file.create_group(group);
    file.set_attribute(group, "x0", g.x0);
    file.set_attribute(group, "y0", g.y0);
    file.set_attribute(group, "spacing", g.spacing);
    ArrayOptions packed;
    packed.compression = kCompression;
    file.write_grid(group + "/undisturbed", g.undisturbed, {g.rows, g.columns}, packed);
    file.set_attribute(group + "/undisturbed", "unit", "m");
    file.set_attribute(group + "/undisturbed", "description", "height before anything touched the ground; row j is y0 + j spacing");
    lay_out(file, group + "/height", {g.rows, g.columns}, "m", "height of the surface");
    if (g.pressure) lay_out(file, group + "/pressure", {g.rows, g.columns}, "Pa", "normal stress under the bodies");
  }
  if (layout_.particles) {
    // H5MD 1.1 (de Buyl, Colberg, Hoefling 2014, Comput. Phys. Commun. 185, 1546).
    const FrameParticles& p = *layout_.particles;
    file.create_group("/h5md");
    file.set_attribute("/h5md", "version", std::vector<double>{1.0, 1.0});
    file.create_group("/h5md/author");
    file.set_attribute("/h5md/author", "name", "terrode");
    file.create_group("/h5md/creator");
    file.set_attribute("/h5md/creator", "name", "terrode");
    file.set_attribute("/h5md/creator", "version", version());
    const std::string group = kParticles;
    file.create_group(group);
    file.create_group(group + "/box");
    file.set_attribute(group + "/box", "dimension", 3);
    file.set_attribute(group + "/box", "low", std::vector<double>{p.low.x(), p.low.y(), p.low.z()});
    const Vec3 edges = p.high - p.low;
    file.write(group + "/box/edges", std::vector<double>{edges.x(), edges.y(), edges.z()});
    file.set_attribute(group + "/box/edges", "unit", "m");
    const auto side = [&](int k) { return std::string(p.periodic[static_cast<std::size_t>(k)] ? "periodic" : "none"); };
    file.write_text(group + "/box/boundary", {side(0), side(1), side(2)});
    file.write(group + "/radius", p.radius);
    file.set_attribute(group + "/radius", "unit", "m");
    const auto element = [&](const char* name, const char* unit, const char* meaning) {
      const std::string path = group + "/" + name;
      file.create_group(path);
      lay_out(file, path + "/value", {p.radius.size(), 3}, unit, meaning);
      lay_out(file, path + "/time", {}, "s", "time of each frame", true);
      ArrayOptions growing;
      growing.extendible = true;
      growing.chunk_rows = 256;
      file.write_grid(path + "/step", std::vector<std::int64_t>{}, {0}, growing);
    };
    element("position", "m", "centres");
    if (p.velocity) element("velocity", "m s-1", "of the centres");
  }
}

void FrameWriter::append(const Frame& frame) {
  Problems problems;
  const auto fits = [&](const char* name, std::size_t size, std::size_t wanted, bool finite) {
    if (size != wanted) add(problems, name, fmt::format("has {} values", size), fmt::format("{}", wanted));
    if (!finite) add(problems, name, "holds a number that is not finite", "finite numbers");
  };
  require(problems, "time", frame.time, "s", count_ == 0 || frame.time > last_time_, "a time after the last frame's");
  fits("bodies", frame.bodies.size(), layout_.bodies.size(), true);
  for (const FrameBodyState& b : frame.bodies)
    if (!b.pose.p_W.allFinite() || !b.pose.R_WB.coeffs().allFinite() || !b.soil.F_W.allFinite() || !b.soil.M_W.allFinite())
      add(problems, "bodies", "hold a number that is not finite", "finite numbers");
  const std::size_t nodes = layout_.ground ? layout_.ground->columns * layout_.ground->rows : 0;
  const std::size_t grains = layout_.particles ? layout_.particles->radius.size() : 0;
  fits("height", frame.height.size(), nodes, all_finite(frame.height));
  fits("pressure", frame.pressure.size(), layout_.ground && layout_.ground->pressure ? nodes : 0, all_finite(frame.pressure));
  fits("position", frame.position.size(), 3 * grains, all_finite(frame.position));
  fits("velocity", frame.velocity.size(), layout_.particles && layout_.particles->velocity ? 3 * grains : 0,
       all_finite(frame.velocity));
  throw_if_any(problems);

  for (std::size_t i = 0; i < frame.bodies.size(); ++i) {
    const std::string group = body_group(layout_.bodies[i]);
    const FrameBodyState& b = frame.bodies[i];
    const Quat& q = b.pose.R_WB;
    file_->append(group + "/position", floats(b.pose.p_W));
    file_->append(group + "/orientation", std::vector<float>{static_cast<float>(q.w()), static_cast<float>(q.x()),
                                                             static_cast<float>(q.y()), static_cast<float>(q.z())});
    file_->append(group + "/force", floats(b.soil.F_W));
    file_->append(group + "/moment", floats(b.soil.M_W));
  }
  const std::string ground = std::string(kFrames) + "/ground";
  if (nodes > 0) file_->append(ground + "/height", frame.height);
  if (!frame.pressure.empty()) file_->append(ground + "/pressure", frame.pressure);
  const auto element = [&](const char* name, const std::vector<float>& values) {
    const std::string path = std::string(kParticles) + "/" + name;
    file_->append(path + "/value", values);
    file_->append(path + "/time", std::vector<double>{frame.time});
    file_->append(path + "/step", std::vector<std::int64_t>{static_cast<std::int64_t>(count_)});
  };
  if (grains > 0) element("position", frame.position);
  if (!frame.velocity.empty()) element("velocity", frame.velocity);
  // The time comes last: a reader that looks on counts frames by it.
  file_->append(std::string(kFrames) + "/time", std::vector<double>{frame.time});
  last_time_ = frame.time;
  ++count_;
}

bool FrameReader::has_frames(const Hdf5File& file) { return file.is_group(kFrames); }

FrameReader::FrameReader(const Hdf5File& file) : file_(&file) {
  const std::string root = kFrames;
  if (!has_frames(file)) malformed(file, root, "is not in the file");
  const auto layout = file.text_attribute(root, "layout");
  if (!layout || !layout->starts_with("frames/1")) malformed(file, root, fmt::format("has layout '{}'", layout.value_or("")));
  if (!file.is_array(root + "/time")) malformed(file, root, "has no times");
  times_ = file.read<double>(root + "/time").values;
  if (file.is_group(root + "/bodies")) {
    std::vector<std::pair<int, FrameBody>> bodies;
    for (const std::string& name : file.children(root + "/bodies")) {
      const std::string group = root + "/bodies/" + name;
      FrameBody b;
      b.name = name;
      const std::string shape = file.text_attribute(group, "shape").value_or("");
      if (shape == "wheel" || shape == "sphere") b.radius = number(file, group, "radius");
      if (shape == "wheel") {
        b.width = number(file, group, "width");
        b.grouser_count = static_cast<int>(number(file, group, "grouser_count"));
        b.grouser_height = number(file, group, "grouser_height");
        b.grouser_thickness = number(file, group, "grouser_thickness");
      } else if (shape == "sphere") {
        b.shape = FrameBody::Shape::sphere;
      } else if (shape == "box") {
        b.shape = FrameBody::Shape::box;
        const auto size = file.numbers_attribute(group, "size");
        if (!size || size->size() != 3) malformed(file, group, "has no size");
        b.size = Vec3((*size)[0], (*size)[1], (*size)[2]);
      } else {
        malformed(file, group, "has shape '" + shape + "'");
      }
      for (const char* what : {"position", "orientation", "force", "moment"})
        if (!file.is_array(group + "/" + what) || file.shape(group + "/" + what).at(0) < times_.size())
          malformed(file, group + "/" + what, "is missing or short");
      bodies.emplace_back(static_cast<int>(number(file, group, "index")), b);
    }
    std::sort(bodies.begin(), bodies.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    for (auto& [index, b] : bodies) layout_.bodies.push_back(std::move(b));
  }
  if (file.is_group(root + "/ground")) {
    const std::string group = root + "/ground";
    FrameGround g;
    g.x0 = number(file, group, "x0");
    g.y0 = number(file, group, "y0");
    g.spacing = number(file, group, "spacing");
    Array<float> undisturbed = file.read<float>(group + "/undisturbed");
    if (undisturbed.shape.size() != 2) malformed(file, group + "/undisturbed", "is no grid");
    g.rows = undisturbed.shape[0];
    g.columns = undisturbed.shape[1];
    g.undisturbed = std::move(undisturbed.values);
    g.pressure = file.is_array(group + "/pressure");
    for (const char* what : {"height", "pressure"}) {
      if (std::string(what) == "pressure" && !g.pressure) continue;
      const auto shape = file.is_array(group + "/" + what) ? file.shape(group + "/" + what) : std::vector<std::size_t>{};
      if (shape.size() != 3 || shape[0] < times_.size() || shape[1] != g.rows || shape[2] != g.columns)
        malformed(file, group + "/" + what, "is missing or of another size than the ground");
    }
    layout_.ground = std::move(g);
  }
  if (file.is_group(kParticles)) {
    const std::string group = kParticles;
    FrameParticles p;
    p.radius = file.read<float>(group + "/radius").values;
    const auto low = file.numbers_attribute(group + "/box", "low");
    const auto edges = file.read<double>(group + "/box/edges").values;
    const auto boundary = file.read_text(group + "/box/boundary");
    if (!low || low->size() != 3 || edges.size() != 3 || boundary.size() != 3) malformed(file, group + "/box", "is not complete");
    for (int k = 0; k < 3; ++k) {
      const auto i = static_cast<std::size_t>(k);
      p.low[k] = (*low)[i];
      p.high[k] = (*low)[i] + edges[i];
      p.periodic[i] = boundary[i] == "periodic";
    }
    p.velocity = file.is_array(group + "/velocity/value");
    for (const char* what : {"position", "velocity"}) {
      if (std::string(what) == "velocity" && !p.velocity) continue;
      const std::string path = group + "/" + what + "/value";
      const auto shape = file.is_array(path) ? file.shape(path) : std::vector<std::size_t>{};
      if (shape.size() != 3 || shape[0] < times_.size() || shape[1] != p.radius.size() || shape[2] != 3)
        malformed(file, path, "is missing or of another size than the particles");
    }
    layout_.particles = std::move(p);
  }
  Problems problems = layout_.validate();
  for (Problem& p : problems) p.file = file.path();
  throw_if_any(problems);
}

Frame FrameReader::read(std::size_t index) const {
  if (index >= times_.size())
    throw InputError({file_->path(), 0, 0, "frame", fmt::format("{} does not exist", index), fmt::format("below {}", times_.size())});
  Frame frame;
  frame.time = times_[index];
  const auto row = [&](const std::string& path) { return file_->read_rows<float>(path, index, 1).values; };
  for (const FrameBody& b : layout_.bodies) {
    const std::string group = body_group(b);
    FrameBodyState state;
    state.pose.p_W = vec(row(group + "/position"));
    const auto q = row(group + "/orientation");
    state.pose.R_WB = Quat(q.at(0), q.at(1), q.at(2), q.at(3)).normalized();
    state.soil.F_W = vec(row(group + "/force"));
    state.soil.M_W = vec(row(group + "/moment"));
    frame.bodies.push_back(state);
  }
  if (layout_.ground) {
    frame.height = row(std::string(kFrames) + "/ground/height");
    if (layout_.ground->pressure) frame.pressure = row(std::string(kFrames) + "/ground/pressure");
  }
  if (layout_.particles) {
    frame.position = row(std::string(kParticles) + "/position/value");
    if (layout_.particles->velocity) frame.velocity = row(std::string(kParticles) + "/velocity/value");
  }
  return frame;
}

}  // namespace terrode::recording
