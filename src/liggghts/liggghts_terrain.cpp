#include "liggghts/liggghts_terrain.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <condition_variable>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <mutex>
#include <optional>
#include <thread>
#include <unordered_map>

#include "core/system_error.h"
#include "liggghts/law.h"
#include "liggghts/wheel_mesh.h"
#include "liggghts/workers.h"

namespace terrode::liggghts {
namespace {

// The right to LIGGGHTS, which lives once in a process.
class Lease {
 public:
  Lease() {
    std::unique_lock lock(mutex);
    if (held && holder == std::this_thread::get_id())
      throw RunError("LIGGGHTS carries one ground at a time: end the one that has begun");
    free.wait(lock, [] { return !held; });
    held = true;
    holder = std::this_thread::get_id();
  }
  ~Lease() {
    {
      const std::lock_guard lock(mutex);
      held = false;
    }
    free.notify_one();
  }
  Lease(const Lease&) = delete;
  Lease& operator=(const Lease&) = delete;

 private:
  static inline std::mutex mutex;
  static inline std::condition_variable free;
  static inline bool held = false;
  static inline std::thread::id holder;
};

// A folder that is gone with its owner: LIGGGHTS reads beds and meshes from files.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "terrode-liggghts-XXXXXX").string();
    if (!mkdtemp(name.data())) throw RunError(fmt::format("{}: cannot be made: {}", name, system_error_text(errno)));
    path_ = name;
  }
  ~TemporaryFolder() {
    std::error_code error;
    std::filesystem::remove_all(path_, error);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  std::string file(const std::string& name) const { return (path_ / name).string(); }

 private:
  std::filesystem::path path_;
};

void write(const std::string& path, const std::string& text) {
  std::ofstream out(path, std::ios::binary);
  out.write(text.data(), static_cast<std::streamsize>(text.size()));
  out.close();
  if (!out) throw RunError(fmt::format("{}: cannot be written", path));
}

std::string read(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::string text((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  if (!in) throw RunError(fmt::format("{}: cannot be read", path));
  return text;
}

class LiggghtsTerrain final : public dem::ParticleGround {
 public:
  explicit LiggghtsTerrain(const LiggghtsParams& params);

  terrain::BodyId add_body(std::shared_ptr<const wheel::Body> shape) override;
  double height(double x, double y) const override;
  std::vector<std::uint8_t> snapshot() const override;
  void restore(std::span<const std::uint8_t> bytes) override;
  std::string name() const override { return "mpi"; }
  void particles(std::vector<float>& position, std::vector<float>& radius) const override;

 private:
  struct Grains {
    std::vector<Vec3> position;  // by number, within the width along y
    std::vector<double> radius;
    std::unordered_map<std::int64_t, std::vector<int>> cells;  // by place seen from above
  };

  void advance() override;
  void take_back() override;
  long tile_of(double x) const { return static_cast<long>(std::floor(x / params_.prism.width)); }
  void lay();
  void move_window();
  void require_within_bed() const;
  std::string settings(const TemporaryFolder& folder, const std::string& bed, bool again) const;
  const Grains& grains() const;
  static std::int64_t cell(long i, long j) { return static_cast<std::int64_t>(i) * 1000003 + j; }

  double reach_behind_ = 0.0, reach_ahead_ = 0.0;
  double smallest_ = 0.0, time_step_ = 0.0;
  std::vector<TriangleMesh> meshes_;
  std::vector<Pose> at_;  // where LIGGGHTS has each body
  std::optional<Lease> lease_;
  double from_ = 0.0, to_ = 0.0;         // m along x that is laid
  std::size_t count_ = 0;                // grains
  long free_from_ = 0, free_to_ = -1;    // stretches that move
  double engine_step_ = 0.0;             // s, as LIGGGHTS has it
  mutable std::optional<Grains> grains_;  // as they are now
};

const dem::DemTerrainParams& checked(const LiggghtsParams& params) {
  throw_if_any(params.validate());
  return params.bed;
}

LiggghtsTerrain::LiggghtsTerrain(const LiggghtsParams& params)
    : ParticleGround(checked(params)), reach_behind_(params.reach_behind), reach_ahead_(params.reach_ahead) {
  smallest_ = std::numeric_limits<double>::infinity();
  for (const dem::Grain& g : params_.prism.grains) smallest_ = std::min(smallest_, g.radius);
  const double rayleigh = dem::rayleigh_time(smallest_, params_.prism.grain_density, params_.prism.grain);
  time_step_ = params_.time_step > 0.0 ? params_.time_step : dem::suggested_rayleigh_fraction * rayleigh;
  if (time_step_ > dem::largest_rayleigh_fraction * rayleigh)
    throw InputError({{}, 0, 0, "time_step", fmt::format("is {:.4g} s", time_step_),
                      fmt::format("at most {} of the Rayleigh time {:.4g} s", dem::largest_rayleigh_fraction, rayleigh)});
}

terrain::BodyId LiggghtsTerrain::add_body(std::shared_ptr<const wheel::Body> shape) {
  if (!shape) throw InputError("a body needs a shape");
  if (lease_) throw InputError("bodies are put on particles before the first step");
  constexpr double facets = 0.02;  // of the smallest grain's radius
  meshes_.push_back(mesh_of(*shape, facets * smallest_));
  at_.emplace_back();
  return keep(std::move(shape));
}

void LiggghtsTerrain::take_back() {
  throw RunError("a second trial within a step: LIGGGHTS cannot take back the first (the method dem can)");
}

// What is made once: the box, the grains or (`again`) the state they are read from, the law, floor, bodies and their motion.
std::string LiggghtsTerrain::settings(const TemporaryFolder& folder, const std::string& bed, bool again) const {
  std::string out;
  const auto add = [&]<class... A>(fmt::format_string<A...> text, A&&... values) {
    fmt::format_to(std::back_inserter(out), text, std::forward<A>(values)...);
    out += '\n';
  };
  add("atom_style granular");
  add("atom_modify map array");
  add("boundary m p m");  // at least what the bed names, and as far as a grain may fly
  add("newton off");
  add("communicate single vel yes");
  add("units si");
  // A window that moves along x is shared out fairly in strips along it, as far as the width reaches.
  const bool strips = !full() && Workers::instance().count() * 3.0 * largest_ <= bed_width();
  add("processors {} * 1", strips ? "1" : "*");
  add("{}", bed);
  add("neighbor {:.17g} bin", 0.4 * smallest_);
  add("neigh_modify delay 0 every 1 check yes");
  if (!again) {  // a state has its groups
    add("group moving type {}", soil_type);
    add("group standing subtract all all");
  }
  for (const std::string& line : law_commands(params_)) add("{}", line);
  add("neigh_modify exclude group standing standing");
  add("fix gravity all gravity {:.17g} vector 0 0 -1", params_.gravity);
  const std::string model = law_model(params_);
  add("fix floor all wall/gran model {} primitive type {} zplane {:.17g}", model, floor_type, -depth_);
  std::string meshes;
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    const Vec3& p = at_[b].p_W;
    add("fix body{0} all mesh/surface/stress file {1} type {2} reference_point {3:.17g} {4:.17g} {5:.17g}", b,
        folder.file(fmt::format("body{}.stl", b)), wheel_type, p.x(), p.y(), p.z());
    meshes += fmt::format(" body{}", b);
  }
  if (!bodies_.empty()) {
    add("fix bodies all wall/gran model {} mesh n_meshes {} meshes{} store_force yes", model, bodies_.size(), meshes);
    for (std::size_t b = 0; b < bodies_.size(); ++b)
      for (int k = 0; k < 6; ++k) add("variable body{}_{} equal 0.0", b, k);
    for (std::size_t b = 0; b < bodies_.size(); ++b) {
      const Vec3& p = at_[b].p_W;
      add("fix slide{0} all move/mesh mesh body{0} linear/variable v_body{0}_0 v_body{0}_1 v_body{0}_2", b);
      for (int k = 0; k < 3; ++k)
        add("fix turn{0}_{1} all move/mesh mesh body{0} rotate/variable origin {2:.17g} {3:.17g} {4:.17g} axis {5} {6} {7} omega v_body{0}_{8}",
            b, k, p.x(), p.y(), p.z(), k == 0 ? 1 : 0, k == 1 ? 1 : 0, k == 2 ? 1 : 0, k + 3);
    }
  }
  add("fix motion moving nve/sphere");
  add("fix stand standing freeze");
  add("thermo_style custom step atoms");
  add("thermo_modify lost ignore norm no");  // counted by ourselves: its own count begins with what it does not initialise
  add("thermo 1000000000");
  return out;
}

void LiggghtsTerrain::lay() {
  const dem::DemTerrainParams& p = params_;
  for (const Announced& b : bodies_)
    if (!b.announced) throw RunError("every body's motion must be announced in the first step on LIGGGHTS");
  lease_.emplace();
  const TemporaryFolder folder;
  const double length = p.prism.width;
  double start = 0.0;
  long tiles = 0;
  if (full()) {
    start = -p.full_behind;
    tiles = static_cast<long>(std::ceil(p.full_length / length - 1e-9));
  } else {
    double widest = 0.0;
    for (const Announced& b : bodies_) widest = std::max(widest, reach(b));
    const long first = tile_of(-reach_behind_ - std::max(p.window_behind, widest)) - 1;
    start = static_cast<double>(first) * length;
    tiles = tile_of(reach_ahead_ + std::max(p.window_ahead, widest)) + 2 - first;
  }
  from_ = start;
  to_ = start + static_cast<double>(tiles) * length;
  double room = 0.0, top = roughness();
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    at_[b] = bodies_[b].pose;
    const double radius = bodies_[b].shape->bounding_radius();
    room = std::max(room, radius);
    top = std::max(top, at_[b].p_W.z() + 2.0 * radius);
    write(folder.file(fmt::format("body{}.stl", b)), stl(meshes_[b], at_[b]));
  }
  const dem::Bed strip = dem::tile(p.prism, 1, p.tiles_y);
  count_ = strip.grains.size() * static_cast<std::size_t>(tiles);
  std::string data = "bed\n\n";
  const auto out = std::back_inserter(data);
  const double margin = largest_;
  fmt::format_to(out, "{} atoms\n3 atom types\n\n{:.17g} {:.17g} xlo xhi\n{:.17g} {:.17g} ylo yhi\n{:.17g} {:.17g} zlo zhi\n\nAtoms\n\n",
                 count_, from_ - room - margin, to_ + room + margin, -0.5 * bed_width(), 0.5 * bed_width(), -depth_ - margin, top + margin);
  std::size_t number = 0;
  for (long k = 0; k < tiles; ++k) {
    const Vec3 origin(start + static_cast<double>(k) * length, -0.5 * bed_width(), -depth_);
    for (const dem::Grain& g : strip.grains) {
      const Vec3 x = origin + g.position;
      fmt::format_to(out, "{} {} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g}\n", ++number, soil_type, 2.0 * g.radius, p.prism.grain_density,
                     x.x(), x.y(), x.z());
    }
  }
  write(folder.file("bed.data"), data);
  Workers& workers = Workers::instance();
  workers.forget();
  workers.commands(settings(folder, "read_data " + folder.file("bed.data"), false));
  engine_step_ = 0.0;
}

void LiggghtsTerrain::require_within_bed() const {
  const double low = full() ? from_ + params_.border : -reach_behind_, high = full() ? to_ - params_.border : reach_ahead_;
  for (const Announced& b : bodies_) {
    if (!b.announced) continue;
    const double x = b.pose.p_W.x(), y = b.pose.p_W.y();
    if (x < low || x > high)
      throw RunError(fmt::format("a wheel is at x = {:.4g} m, beyond the bed that is laid for it from {:.4g} to {:.4g} m (dem lays it as it goes)", x, low, high));
    if (std::abs(y) > 0.5 * bed_width())
      throw RunError(fmt::format("a wheel is at y = {:.4g} m, beyond the bed that is laid for it to {:.4g} m on either side", y, 0.5 * bed_width()));
  }
}

// Lets the grains move that a window about the bodies holds, or all but the border of a full bed.
void LiggghtsTerrain::move_window() {
  require_within_bed();
  const bool first = free_to_ < free_from_;
  const double width = bed_width(), border = params_.border;
  Workers& workers = Workers::instance();
  if (full()) {
    if (!first) return;
    workers.set_moving({from_ + border, to_ - border, border > 0.0 ? 0.5 * width - border : width, width, {}});
    free_from_ = 0, free_to_ = 0;
    engine_step_ = 0.0;
    return;
  }
  const Range need = window().value_or(first ? Range{0, 0} : Range{free_from_, free_to_});
  if (!first && need.first == free_from_ && need.second == free_to_) return;
  free_from_ = need.first;
  free_to_ = need.second;
  MovingPart part{static_cast<double>(free_from_) * stretch(), static_cast<double>(free_to_ + 1) * stretch(), width, width, {}};
  // A grain that a body may touch before the window moves on stays free: standing, it would be like a rock.
  for (const Announced& b : bodies_)
    if (b.announced) part.axes.push_back({b.pose.p_W.x(), b.pose.p_W.z(), reach(b)});
  workers.set_moving(part);
  engine_step_ = 0.0;
}

void LiggghtsTerrain::advance() {
  if (!lease_) lay();
  move_window();
  Workers& workers = Workers::instance();
  const auto n = static_cast<long>(std::ceil(step_length() / time_step_ * (1.0 - 1e-12)));
  const double dt = step_length() / static_cast<double>(n);
  if (engine_step_ == 0.0 || std::abs(engine_step_ / dt - 1.0) > 1e-9) {
    // A new step or other grains that move want everything set up anew.
    workers.commands(fmt::format("timestep {:.17g}\nrun 0 post no", dt));
    engine_step_ = dt;
  }
  std::vector<BodyMotion> motions(bodies_.size());
  std::vector<Twist> twists(bodies_.size());
  for (std::size_t k = 0; k < bodies_.size(); ++k) {
    BodyMotion& m = motions[k];
    Pose& at = at_[k];
    const Twist& twist = twists[k] = following(bodies_[k], at);
    at.p_W += step_length() * twist.v_W;
    if (const double rate = twist.w_W.norm(); rate > 0.0)
      at.R_WB = (Quat(Eigen::AngleAxisd(rate * step_length(), twist.w_W / rate)) * at.R_WB).normalized();
    for (int i = 0; i < 3; ++i) {
      m.velocity[i] = twist.v_W[i];
      m.spin[i] = twist.w_W[i];
      m.centre[i] = at.p_W[i];
    }
    m.reach = bodies_[k].shape->bounding_radius();
  }
  const std::vector<double> sums = workers.run(n, motions);
  if (const auto left = static_cast<std::size_t>(sums.back()); left != count_)
    throw RunError(fmt::format("LIGGGHTS lost {} of {} grains: try a smaller particles.time_step_fraction", count_ - left, count_));
  for (std::size_t k = 0; k < bodies_.size(); ++k) {
    const double* f = &sums[7 * k];
    const Wrench sum{Vec3(f[0], f[1], f[2]), Vec3(f[3], f[4], f[5])};
    answer(k, sum * (1.0 / static_cast<double>(n)), at_[k], twists[k], static_cast<int>(f[6]));
  }
  grains_.reset();
}

const LiggghtsTerrain::Grains& LiggghtsTerrain::grains() const {
  if (grains_) return *grains_;
  grains_.emplace();
  if (!lease_) return *grains_;
  const std::vector<double> all = Workers::instance().grains();
  grains_->position.resize(count_);
  grains_->radius.resize(count_);
  for (std::size_t k = 0; k + 4 < all.size(); k += 5) {
    const auto number = static_cast<std::size_t>(all[k]) - 1;
    if (number >= count_) throw RunError("LIGGGHTS has a grain that was not laid");
    Vec3 x(all[k + 1], all[k + 2], all[k + 3]);
    x.y() -= bed_width() * std::nearbyint(x.y() / bed_width());
    grains_->position[number] = x;
    grains_->radius[number] = all[k + 4];
    const double side = largest_;
    grains_->cells[cell(std::lround(x.x() / side), std::lround(x.y() / side))].push_back(static_cast<int>(number));
  }
  return *grains_;
}

double LiggghtsTerrain::height(double x, double y) const {
  if (!lease_ || x < from_ || x > to_) return 0.0;
  const Grains& all = grains();
  const double side = largest_;
  y -= bed_width() * std::nearbyint(y / bed_width());
  double top = -depth_;
  // Near a side of the width the neighbour lies across it.
  for (const double shift : {0.0, y > 0.0 ? -bed_width() : bed_width()}) {
    const long ci = std::lround(x / side), cj = std::lround((y + shift) / side);
    for (long i = ci - 1; i <= ci + 1; ++i)
      for (long j = cj - 1; j <= cj + 1; ++j) {
        const auto found = all.cells.find(cell(i, j));
        if (found == all.cells.end()) continue;
        for (const int k : found->second) {
          const Vec3& p = all.position[static_cast<std::size_t>(k)];
          const double r = all.radius[static_cast<std::size_t>(k)], dx = x - p.x(), dy = y + shift - p.y();
          const double below = r * r - dx * dx - dy * dy;
          if (below > 0.0) top = std::max(top, p.z() + std::sqrt(below));
        }
      }
  }
  return top;
}

void LiggghtsTerrain::particles(std::vector<float>& position, std::vector<float>& radius) const {
  const Grains& all = grains();
  for (std::size_t k = 0; k < all.position.size(); ++k) {
    for (const double x : all.position[k]) position.push_back(static_cast<float>(x));
    radius.push_back(static_cast<float>(all.radius[k]));
  }
}

// A few numbers of our own, then LIGGGHTS's restart file: grains, meshes and the history of every contact.
std::vector<std::uint8_t> LiggghtsTerrain::snapshot() const {
  if (in_step()) throw RunError("a snapshot within a step");
  std::vector<double> own = {lease_ ? 1.0 : 0.0, from_, to_, static_cast<double>(count_), static_cast<double>(free_from_),
                             static_cast<double>(free_to_), static_cast<double>(bodies_.size()), kept_chord_};
  for (const Pose& at : at_) {
    own.insert(own.end(), at.p_W.data(), at.p_W.data() + 3);
    own.insert(own.end(), at.R_WB.coeffs().data(), at.R_WB.coeffs().data() + 4);
  }
  std::string state;
  if (lease_) {
    const TemporaryFolder folder;
    const std::string file = folder.file("state.restart");
    Workers::instance().commands("write_restart " + file);
    state = read(file);
  }
  std::vector<std::uint8_t> out(own.size() * sizeof(double) + state.size());
  std::memcpy(out.data(), own.data(), own.size() * sizeof(double));
  std::memcpy(out.data() + own.size() * sizeof(double), state.data(), state.size());
  return out;
}

void LiggghtsTerrain::restore(std::span<const std::uint8_t> bytes) {
  abandon_step();
  std::vector<double> own(8 + 7 * bodies_.size());
  const std::size_t head = own.size() * sizeof(double);
  const auto wrong = [] { return InputError(Problem{{}, 0, 0, "ground", "is not a saved state of these bodies on LIGGGHTS", {}}); };
  if (bytes.size() < head) throw wrong();
  std::memcpy(own.data(), bytes.data(), head);
  const bool laid = own[0] == 1.0;
  if ((!laid && own[0] != 0.0) || own[6] != static_cast<double>(bodies_.size()) || laid != (bytes.size() > head) ||
      !std::all_of(own.begin(), own.end(), [](double v) { return std::abs(v) < 1e12; }))
    throw wrong();
  grains_.reset();
  if (!laid) {
    lease_.reset();
    free_from_ = 0, free_to_ = -1;
    kept_chord_ = 0.0;
    return;
  }
  from_ = own[1], to_ = own[2];
  count_ = static_cast<std::size_t>(own[3]);
  free_from_ = static_cast<long>(own[4]), free_to_ = static_cast<long>(own[5]);
  kept_chord_ = own[7];
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    const double* n = &own[8 + 7 * b];
    at_[b] = {Vec3(n[0], n[1], n[2]), Quat(n[6], n[3], n[4], n[5])};
  }
  if (!lease_) lease_.emplace();
  const TemporaryFolder folder;
  // LIGGGHTS wants a mesh's file to be there, and takes the mesh from the state.
  for (std::size_t b = 0; b < bodies_.size(); ++b) write(folder.file(fmt::format("body{}.stl", b)), stl(meshes_[b], at_[b]));
  const std::string file = folder.file("state.restart");
  write(file, std::string(reinterpret_cast<const char*>(bytes.data()) + head, bytes.size() - head));
  Workers& workers = Workers::instance();
  workers.forget();
  workers.commands(settings(folder, "read_restart " + file, true));
  engine_step_ = 0.0;
}

}  // namespace

std::unique_ptr<terrain::Terrain> make_terrain(LiggghtsParams params) { return std::make_unique<LiggghtsTerrain>(params); }

}  // namespace terrode::liggghts
