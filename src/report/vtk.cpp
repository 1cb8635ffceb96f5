#include "report/vtk.h"

#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <numbers>
#include <type_traits>

#include "report/png.h"
#include "report/svg.h"

namespace terrode::report {
namespace {

using recording::Frame;
using recording::FrameBody;
using recording::FrameLayout;

template <typename T>
constexpr const char* type_name() {
  if constexpr (std::is_same_v<T, float>) return "Float32";
  if constexpr (std::is_same_v<T, double>) return "Float64";
  if constexpr (std::is_same_v<T, std::int32_t>) return "Int32";
  if constexpr (std::is_same_v<T, std::int64_t>) return "Int64";
}

// <DataArray> with its values as base64 behind their length in bytes.
template <typename T>
std::string array(const std::string& name, const std::vector<T>& values, int components = 1) {
  const auto bytes = static_cast<std::uint64_t>(values.size() * sizeof(T));
  std::string raw(sizeof bytes + bytes, '\0');
  std::memcpy(raw.data(), &bytes, sizeof bytes);
  if (bytes > 0) std::memcpy(raw.data() + sizeof bytes, values.data(), bytes);
  return fmt::format("<DataArray type=\"{}\"{} NumberOfComponents=\"{}\" format=\"binary\">", type_name<T>(),
                     name.empty() ? "" : " Name=\"" + name + "\"", components) +
         base64(raw) + "</DataArray>\n";
}

std::string document(const char* type, const std::string& body) {
  static_assert(std::endian::native == std::endian::little);
  return fmt::format("<?xml version=\"1.0\"?>\n<VTKFile type=\"{0}\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n", type) +
         body + "</VTKFile>\n";
}

// Corners and faces in body axes.
struct Mesh {
  std::vector<Vec3> points;
  std::vector<std::vector<std::int64_t>> faces;
  void face(const std::vector<Vec3>& corners) {
    std::vector<std::int64_t> f;
    for (const Vec3& c : corners) {
      f.push_back(static_cast<std::int64_t>(points.size()));
      points.push_back(c);
    }
    faces.push_back(f);
  }
};

Mesh mesh_of(const FrameBody& body) {
  Mesh m;
  constexpr double kTurn = 2.0 * std::numbers::pi;
  if (body.shape == FrameBody::Shape::box) {
    const Vec3 h = 0.5 * body.size;
    for (int axis = 0; axis < 3; ++axis)
      for (double side : {-1.0, 1.0}) {
        std::vector<Vec3> corners;
        const double around[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
        for (const auto& [u, v] : around) {
          Vec3 c;
          c[axis] = side * h[axis];
          c[(axis + 1) % 3] = side * u * h[(axis + 1) % 3];
          c[(axis + 2) % 3] = v * h[(axis + 2) % 3];
          corners.push_back(c);
        }
        m.face(corners);
      }
    return m;
  }
  if (body.shape == FrameBody::Shape::sphere) {
    constexpr int kRings = 16, kSegments = 32;
    const auto at = [&](int i, int j) {
      const double a = std::numbers::pi * i / kRings, b = kTurn * j / kSegments;
      return Vec3(body.radius * Vec3(std::sin(a) * std::cos(b), std::sin(a) * std::sin(b), std::cos(a)));
    };
    for (int i = 0; i < kRings; ++i)
      for (int j = 0; j < kSegments; ++j) m.face({at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
    return m;
  }
  constexpr int kSegments = 96;
  const double w = 0.5 * body.width, r = body.radius;
  const auto rim = [&](double angle, double radius, double y) { return Vec3(radius * std::sin(angle), y, radius * std::cos(angle)); };
  for (int i = 0; i < kSegments; ++i) {
    const double a = kTurn * i / kSegments, b = kTurn * (i + 1) / kSegments;
    m.face({rim(a, r, -w), rim(a, r, w), rim(b, r, w), rim(b, r, -w)});
  }
  for (double y : {-w, w}) {
    std::vector<Vec3> cap;
    for (int i = 0; i < kSegments; ++i) cap.push_back(rim((y > 0 ? kTurn : -kTurn) * i / kSegments, r, y));
    m.face(cap);
  }
  for (int i = 0; i < body.grouser_count; ++i) {
    const double a = kTurn * i / body.grouser_count, h = 0.5 * body.grouser_thickness;
    const Vec3 out = -rim(a, 1.0, 0.0), along(-std::cos(a), 0.0, std::sin(a)), across(0.0, 1.0, 0.0);
    const auto at = [&](double radius, double side, double y) { return Vec3(radius * out + side * h * along + y * across); };
    const double tip = r + body.grouser_height;
    m.face({at(tip, -1, -w), at(tip, -1, w), at(tip, 1, w), at(tip, 1, -w)});
    m.face({at(r, 1, -w), at(tip, 1, -w), at(tip, 1, w), at(r, 1, w)});
    m.face({at(r, -1, w), at(tip, -1, w), at(tip, -1, -w), at(r, -1, -w)});
    for (double y : {-w, w}) m.face({at(r, -1, y), at(r, 1, y), at(tip, 1, y), at(tip, -1, y)});
  }
  return m;
}

void push(std::vector<float>& out, const Vec3& v) {
  for (int k = 0; k < 3; ++k) out.push_back(static_cast<float>(v[k]));
}

std::string ground_file(const FrameLayout& layout, const Frame& frame) {
  const recording::FrameGround& g = *layout.ground;
  std::vector<float> points, sinkage;
  points.reserve(3 * frame.height.size());
  for (std::size_t j = 0; j < g.rows; ++j)
    for (std::size_t i = 0; i < g.columns; ++i) {
      const std::size_t n = j * g.columns + i;
      push(points, {g.x0 + static_cast<double>(i) * g.spacing, g.y0 + static_cast<double>(j) * g.spacing, frame.height[n]});
      sinkage.push_back(g.undisturbed[n] - frame.height[n]);
    }
  const std::string extent = fmt::format("0 {} 0 {} 0 0", g.columns - 1, g.rows - 1);
  std::string body = "<StructuredGrid WholeExtent=\"" + extent + "\"><Piece Extent=\"" + extent + "\">\n<PointData Scalars=\"sinkage\">\n" +
                     array("sinkage", sinkage) + array("height", frame.height);
  if (!frame.pressure.empty()) body += array("pressure", frame.pressure);
  return document("StructuredGrid", body + "</PointData>\n<Points>\n" + array("points", points, 3) + "</Points>\n</Piece></StructuredGrid>\n");
}

std::string bodies_file(const std::vector<Mesh>& meshes, const Frame& frame) {
  std::vector<float> points;
  std::vector<std::int64_t> connectivity, offsets;
  std::vector<std::int32_t> index;
  for (std::size_t b = 0; b < meshes.size(); ++b) {
    const auto base = static_cast<std::int64_t>(points.size() / 3);
    const Pose& pose = frame.bodies[b].pose;
    for (const Vec3& p : meshes[b].points) push(points, pose.p_W + pose.R_WB * p);
    for (const auto& face : meshes[b].faces) {
      for (std::int64_t corner : face) connectivity.push_back(base + corner);
      offsets.push_back(static_cast<std::int64_t>(connectivity.size()));
      index.push_back(static_cast<std::int32_t>(b));
    }
  }
  return document("PolyData", fmt::format("<PolyData><Piece NumberOfPoints=\"{}\" NumberOfVerts=\"0\" NumberOfLines=\"0\" NumberOfStrips=\"0\" NumberOfPolys=\"{}\">\n",
                                          points.size() / 3, offsets.size()) +
                                  "<CellData Scalars=\"body\">\n" + array("body", index) + "</CellData>\n<Points>\n" + array("points", points, 3) +
                                  "</Points>\n<Polys>\n" + array("connectivity", connectivity) + array("offsets", offsets) + "</Polys>\n</Piece></PolyData>\n");
}

// Points alone, each a vertex.
std::string points_file(const std::vector<float>& points, const std::string& data) {
  const std::size_t n = points.size() / 3;
  std::vector<std::int64_t> connectivity(n), offsets(n);
  for (std::size_t i = 0; i < n; ++i) {
    connectivity[i] = static_cast<std::int64_t>(i);
    offsets[i] = static_cast<std::int64_t>(i + 1);
  }
  return document("PolyData", fmt::format("<PolyData><Piece NumberOfPoints=\"{0}\" NumberOfVerts=\"{0}\" NumberOfLines=\"0\" NumberOfStrips=\"0\" NumberOfPolys=\"0\">\n", n) +
                                  "<PointData>\n" + data + "</PointData>\n<Points>\n" + array("points", points, 3) + "</Points>\n<Verts>\n" +
                                  array("connectivity", connectivity) + array("offsets", offsets) + "</Verts>\n</Piece></PolyData>\n");
}

std::string forces_file(const Frame& frame) {
  std::vector<float> points, force, moment;
  for (const auto& body : frame.bodies) {
    push(points, body.pose.p_W);
    push(force, body.soil.F_W);
    push(moment, body.soil.M_W);
  }
  return points_file(points, array("force", force, 3) + array("moment", moment, 3));
}

std::string particles_file(const FrameLayout& layout, const Frame& frame) {
  std::vector<std::int32_t> id(layout.particles->radius.size());
  for (std::size_t i = 0; i < id.size(); ++i) id[i] = static_cast<std::int32_t>(i);
  std::string data = array("radius", layout.particles->radius) + array("id", id);
  if (!frame.velocity.empty()) data += array("velocity", frame.velocity, 3);
  return points_file(frame.position, data);
}

}  // namespace

std::vector<std::filesystem::path> write_vtk(const recording::FrameReader& frames, const std::filesystem::path& path,
                                             const Progress& progress) {
  std::filesystem::path pvd = path;
  if (pvd.extension() != ".pvd") pvd += ".pvd";
  const std::filesystem::path folder = pvd.parent_path() / (pvd.stem().string() + "_frames");
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw RunError("cannot make the folder " + folder.string() + ": " + error.message());
  const FrameLayout& layout = frames.layout();
  std::vector<Mesh> meshes;
  for (const FrameBody& body : layout.bodies) meshes.push_back(mesh_of(body));

  std::vector<std::filesystem::path> written;
  const auto write = [&](const std::filesystem::path& file, const std::string& text) {
    std::ofstream out(file, std::ios::binary);
    out << text;
    out.close();
    if (!out) throw RunError("cannot write " + file.string());
    written.push_back(file);
  };
  std::string list;
  const auto collect = [&] {
    return "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"1.0\" byte_order=\"LittleEndian\">\n<Collection>\n" + list +
           "</Collection>\n</VTKFile>\n";
  };
  for (std::size_t k = 0; k < frames.count(); ++k) {
    if (progress.stop_requested()) {
      write(pvd, collect());
      throw Interrupted(fmt::format("stopped after {} of {} frames; {} holds those", k, frames.count(), pvd.string()));
    }
    const Frame frame = frames.read(k);
    int part = 0;
    const auto add = [&](const char* name, const char* extension, const std::string& text) {
      const std::string file = fmt::format("{}_{:04}.{}", name, k, extension);
      write(folder / file, text);
      list += fmt::format("<DataSet timestep=\"{}\" group=\"\" part=\"{}\" name=\"{}\" file=\"{}/{}\"/>\n", frame.time, part++, name,
                          escape(folder.filename().string()), file);
    };
    if (layout.ground) add("ground", "vts", ground_file(layout, frame));
    if (!meshes.empty()) {
      add("bodies", "vtp", bodies_file(meshes, frame));
      add("forces", "vtp", forces_file(frame));
    }
    if (layout.particles) add("particles", "vtp", particles_file(layout, frame));
    progress.report(static_cast<double>(k + 1) / static_cast<double>(frames.count()), "writing frames");
  }
  write(pvd, collect());
  return written;
}

}  // namespace terrode::report
