#include "recording/hdf5_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <hdf5.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <limits>
#include <mutex>
#include <numeric>
#include <utility>

#include "core/system_error.h"
#include "recording/hdf5_lock.h"

namespace terrode::recording {

std::recursive_mutex& hdf5_lock() {
  static std::recursive_mutex lock;
  return lock;
}

namespace {

std::recursive_mutex& library_lock() { return hdf5_lock(); }
using Guard = std::lock_guard<std::recursive_mutex>;

// Errors are collected by failure() and thrown; the library must not print them.
void silence_library() {
  static const bool done = [] {
    // Files are closed by their owners; the library's own clean-up at exit crashes on one whose last flush failed.
    H5dont_atexit();
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
    return true;
  }();
  (void)done;
}

// The library's error stack as one line: the innermost cause first, since that says most.
std::string error_text() {
  std::vector<std::string> messages;
  auto collect = [](unsigned, const H5E_error2_t* error, void* out) -> herr_t {
    if (error->desc && *error->desc) static_cast<std::vector<std::string>*>(out)->push_back(error->desc);
    return 0;
  };
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, collect, &messages);
  H5Eclear2(H5E_DEFAULT);
  if (messages.empty()) return "unknown HDF5 error";
  // Where the system said why, its words are enough: "No space left on device".
  const std::string mark = "error message = '";
  if (const auto at = messages.front().find(mark); at != std::string::npos) {
    const auto begin = at + mark.size();
    return messages.front().substr(begin, messages.front().find('\'', begin) - begin);
  }
  return messages.size() == 1 ? messages.front() : messages.front() + " (" + messages.back() + ")";
}

class Handle {
 public:
  using Closer = herr_t (*)(hid_t);
  Handle() = default;
  Handle(hid_t id, Closer closer) : id_(id), closer_(closer) {}
  Handle(Handle&& o) noexcept : id_(std::exchange(o.id_, H5I_INVALID_HID)), closer_(o.closer_) {}
  Handle& operator=(Handle&& o) noexcept {
    if (this != &o) {
      reset();
      id_ = std::exchange(o.id_, H5I_INVALID_HID);
      closer_ = o.closer_;
    }
    return *this;
  }
  ~Handle() { reset(); }
  operator hid_t() const { return id_; }
  bool valid() const { return id_ >= 0; }
  herr_t reset() {
    const hid_t id = std::exchange(id_, H5I_INVALID_HID);
    return id >= 0 && closer_ ? closer_(id) : 0;
  }

 private:
  hid_t id_ = H5I_INVALID_HID;
  Closer closer_ = nullptr;
};

template <typename T>
hid_t native_type() {
  if constexpr (std::is_same_v<T, double>) return H5T_NATIVE_DOUBLE;
  if constexpr (std::is_same_v<T, float>) return H5T_NATIVE_FLOAT;
  if constexpr (std::is_same_v<T, int>) return H5T_NATIVE_INT;
  if constexpr (std::is_same_v<T, std::int64_t>) return H5T_NATIVE_INT64;
  if constexpr (std::is_same_v<T, std::uint8_t>) return H5T_NATIVE_UINT8;
}

Handle text_type(std::size_t size) {
  Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(type, std::max<std::size_t>(size, 1));
  H5Tset_cset(type, H5T_CSET_UTF8);
  H5Tset_strpad(type, H5T_STR_NULLPAD);
  return type;
}

std::size_t product(const std::vector<std::size_t>& shape, std::size_t from = 0) {
  return std::accumulate(shape.begin() + static_cast<std::ptrdiff_t>(from), shape.end(), std::size_t{1},
                         std::multiplies<>());
}

constexpr std::size_t kChunkBytes = 64 * 1024;
constexpr std::size_t kMaxRank = 4;

Handle access_properties(bool swmr) {
  Handle fapl(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  // Single-writer mode needs the 1.10 file format; a lock that the file system lacks must not stop us.
  H5Pset_libver_bounds(fapl, swmr ? H5F_LIBVER_V110 : H5F_LIBVER_EARLIEST, H5F_LIBVER_LATEST);
  H5Pset_file_locking(fapl, true, true);
  H5Pset_fclose_degree(fapl, H5F_CLOSE_STRONG);
  return fapl;
}

}  // namespace

struct Hdf5File::State {
  std::string path;
  Handle file;
  bool appending = false;
  // Arrays being appended to, kept open: opening one for each row would cost more than writing it.
  struct Open {
    std::string path;
    Handle array;
    std::vector<hsize_t> shape;
  };
  std::vector<Open> open_arrays;

  [[noreturn]] void fail(const std::string& what) const {
    throw RunError(fmt::format("{}: {}: {}", path, what, error_text()));
  }
  void need_open() const {
    if (!file.valid()) throw RunError(path + ": the file is closed");
  }
  void need_layout(const std::string& what) const {
    need_open();
    if (appending) throw RunError(fmt::format("{}: cannot {} once appending has started", path, what));
  }
  Handle open_object(const std::string& object) const {
    need_open();
    Handle h(H5Oopen(file, object.c_str(), H5P_DEFAULT), H5Oclose);
    if (!h.valid()) fail(fmt::format("no '{}' in it", object));
    return h;
  }
  Handle open_array(const std::string& array) const {
    need_open();
    Handle h(H5Dopen2(file, array.c_str(), H5P_DEFAULT), H5Dclose);
    if (!h.valid()) fail(fmt::format("cannot open the array '{}'", array));
    return h;
  }
  std::vector<std::size_t> shape_of(hid_t array) const {
    const Handle space(H5Dget_space(array), H5Sclose);
    const int rank = H5Sget_simple_extent_ndims(space);
    if (rank < 0) fail("cannot read the shape of an array");
    std::vector<hsize_t> dims(static_cast<std::size_t>(rank));
    if (rank > 0) H5Sget_simple_extent_dims(space, dims.data(), nullptr);
    return {dims.begin(), dims.end()};
  }
  // Before memory is asked for. Throws RunError where a damaged or hostile file declares what it cannot hold.
  void need_storable(const std::vector<std::size_t>& shape, std::size_t size, const std::string& what) const {
    hsize_t bytes = 0;
    H5Fget_filesize(file, &bytes);
    std::uint64_t count = 1;
    for (const std::size_t n : shape) {
      if (n != 0 && count > std::numeric_limits<std::uint64_t>::max() / n) count = std::numeric_limits<std::uint64_t>::max();
      else count *= n;
    }
    if (!could_be_stored(count, size, bytes))
      throw RunError(fmt::format("{}: '{}' declares more values than a file of {} bytes can hold", path, what, bytes));
  }
  // Link by link, because H5Lexists fails on a missing parent.
  bool exists(const std::string& object) const {
    need_open();
    if (object == "/") return true;
    for (std::size_t at = 1; at != std::string::npos;) {
      at = object.find('/', at);
      if (H5Lexists(file, object.substr(0, at).c_str(), H5P_DEFAULT) <= 0) {
        H5Eclear2(H5E_DEFAULT);
        return false;
      }
      if (at != std::string::npos) ++at;
    }
    return H5Oexists_by_name(file, object.c_str(), H5P_DEFAULT) > 0;
  }
  H5O_type_t kind(const std::string& object) const {
    if (!exists(object)) return H5O_TYPE_UNKNOWN;
    H5O_info_t info;
    if (H5Oget_info_by_name2(file, object.c_str(), &info, H5O_INFO_BASIC, H5P_DEFAULT) < 0) return H5O_TYPE_UNKNOWN;
    return info.type;
  }
  void replace_attribute(const std::string& object, const std::string& name, hid_t type, hid_t space, const void* data) {
    need_layout("set an attribute");
    const Handle o = open_object(object);
    if (H5Aexists(o, name.c_str()) > 0) H5Adelete(o, name.c_str());
    const Handle a(H5Acreate2(o, name.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
    if (!a.valid() || H5Awrite(a, type, data) < 0) fail(fmt::format("cannot write attribute '{}' of '{}'", name, object));
  }
  Handle find_attribute(const std::string& object, const std::string& name) const {
    const Handle o = open_object(object);
    if (H5Aexists(o, name.c_str()) <= 0) return {};
    return Handle(H5Aopen(o, name.c_str(), H5P_DEFAULT), H5Aclose);
  }
  // Text of either storage (fixed or variable length) from an attribute or array.
  std::vector<std::string> read_strings(hid_t from, bool is_attribute) const {
    const Handle type(is_attribute ? H5Aget_type(from) : H5Dget_type(from), H5Tclose);
    const Handle space(is_attribute ? H5Aget_space(from) : H5Dget_space(from), H5Sclose);
    const hssize_t count = H5Sget_simple_extent_npoints(space);
    std::vector<std::string> out;
    if (count <= 0) return out;
    const auto n = static_cast<std::size_t>(count);
    need_storable({n, H5Tget_size(type)}, 1, "text");
    if (H5Tis_variable_str(type) > 0) {
      Handle memory(H5Tcopy(H5T_C_S1), H5Tclose);
      H5Tset_size(memory, H5T_VARIABLE);
      H5Tset_cset(memory, H5Tget_cset(type));
      std::vector<char*> raw(n, nullptr);
      const herr_t status = is_attribute ? H5Aread(from, memory, raw.data())
                                         : H5Dread(from, memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, raw.data());
      if (status < 0) fail("cannot read text");
      for (char* s : raw) out.emplace_back(s ? s : "");
      H5Dvlen_reclaim(memory, space, H5P_DEFAULT, raw.data());
    } else {
      const std::size_t size = H5Tget_size(type);
      std::string raw(n * size, '\0');
      const herr_t status = is_attribute ? H5Aread(from, type, raw.data())
                                         : H5Dread(from, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, raw.data());
      if (status < 0) fail("cannot read text");
      const bool spaces = H5Tget_strpad(type) == H5T_STR_SPACEPAD;
      for (std::size_t i = 0; i < n; ++i) {
        std::string s = raw.substr(i * size, size);
        s.resize(std::min(s.find('\0'), s.size()));
        while (spaces && !s.empty() && s.back() == ' ') s.pop_back();
        out.push_back(std::move(s));
      }
    }
    return out;
  }
};

Hdf5File::Hdf5File(std::unique_ptr<State> state) : state_(std::move(state)) {}
Hdf5File::Hdf5File(Hdf5File&&) noexcept = default;

Hdf5File& Hdf5File::operator=(Hdf5File&& other) noexcept {
  if (this != &other) {
    const Guard guard(library_lock());
    state_ = std::move(other.state_);
  }
  return *this;
}

Hdf5File::~Hdf5File() {
  const Guard guard(library_lock());
  state_.reset();
}

const std::string& Hdf5File::path() const { return state_->path; }

Hdf5File Hdf5File::create(const std::string& path) {
  const Guard guard(library_lock());
  silence_library();
  auto state = std::make_unique<State>();
  state->path = path;
  const Handle fapl = access_properties(true);
  state->file = Handle(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, fapl), H5Fclose);
  if (!state->file.valid()) state->fail("cannot create the file");
  return Hdf5File(std::move(state));
}

namespace {

void need_hdf5(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) throw InputError(Problem{path, 0, 0, {}, "no such file", "an HDF5 file"});
  if (std::filesystem::is_directory(path, error))
    throw InputError(Problem{path, 0, 0, {}, "is a folder", "an HDF5 file"});
  const int fd = ::open(path.c_str(), O_RDONLY);
  if (fd < 0) throw InputError(Problem{path, 0, 0, {}, std::string("cannot be read: ") + system_error_text(errno), {}});
  // The signature stands at 0, or at 512, 1024, 2048 ... behind a user block (MATLAB v7.3 has one of 512 bytes).
  bool found = false;
  for (off_t at = 0; at <= 8192 && !found; at = at == 0 ? 512 : 2 * at) {
    char signature[8];
    found = ::pread(fd, signature, 8, at) == 8 && std::memcmp(signature, "\211HDF\r\n\032\n", 8) == 0;
  }
  ::close(fd);
  if (!found) throw InputError(Problem{path, 0, 0, {}, "is not an HDF5 file", {}});
}

}  // namespace

Hdf5File Hdf5File::open(const std::string& path) {
  const Guard guard(library_lock());
  silence_library();
  need_hdf5(path);
  auto state = std::make_unique<State>();
  state->path = path;
  const Handle fapl = access_properties(false);
  state->file = Handle(H5Fopen(path.c_str(), H5F_ACC_RDONLY, fapl), H5Fclose);
  if (!state->file.valid()) {
    const std::string first = error_text();
    // A checksum that does not fit is read again, each time after twice the pause: 24 times are 17 ms, the library's 100 for ever.
    H5Pset_metadata_read_attempts(fapl, 24);
    state->file = Handle(H5Fopen(path.c_str(), H5F_ACC_RDONLY | H5F_ACC_SWMR_READ, fapl), H5Fclose);
    H5Eclear2(H5E_DEFAULT);
    if (!state->file.valid()) throw InputError(Problem{path, 0, 0, {}, "cannot be opened: " + first, {}});
  }
  return Hdf5File(std::move(state));
}

Hdf5File Hdf5File::open_for_writing(const std::string& path) {
  const Guard guard(library_lock());
  silence_library();
  need_hdf5(path);
  auto state = std::make_unique<State>();
  state->path = path;
  const Handle fapl = access_properties(true);
  state->file = Handle(H5Fopen(path.c_str(), H5F_ACC_RDWR, fapl), H5Fclose);
  if (!state->file.valid()) state->fail("cannot open the file for writing");
  return Hdf5File(std::move(state));
}

void Hdf5File::flush() {
  const Guard guard(library_lock());
  state_->need_open();
  if (H5Fflush(state_->file, H5F_SCOPE_LOCAL) < 0) state_->fail("cannot write to disk");
  int* descriptor = nullptr;
  if (H5Fget_vfd_handle(state_->file, H5P_DEFAULT, reinterpret_cast<void**>(&descriptor)) >= 0 && descriptor &&
      ::fdatasync(*descriptor) != 0 && errno != EINVAL)
    throw RunError(fmt::format("{}: cannot write to disk: {}", state_->path, system_error_text(errno)));
}

void Hdf5File::close() {
  const Guard guard(library_lock());
  state_->need_open();
  flush();
  state_->open_arrays.clear();
  if (state_->file.reset() < 0) state_->fail("cannot close the file");
}

void Hdf5File::start_appending() {
  const Guard guard(library_lock());
  state_->need_layout("start appending");
  state_->open_arrays.clear();
  if (H5Fstart_swmr_write(state_->file) < 0) state_->fail("cannot start appending");
  state_->appending = true;
}

bool Hdf5File::exists(const std::string& path) const {
  const Guard guard(library_lock());
  return state_->exists(path);
}

bool Hdf5File::is_group(const std::string& path) const {
  const Guard guard(library_lock());
  return state_->kind(path) == H5O_TYPE_GROUP;
}

bool Hdf5File::is_array(const std::string& path) const {
  const Guard guard(library_lock());
  return state_->kind(path) == H5O_TYPE_DATASET;
}

std::vector<std::string> Hdf5File::children(const std::string& group) const {
  const Guard guard(library_lock());
  state_->need_open();
  const Handle g(H5Gopen2(state_->file, group.c_str(), H5P_DEFAULT), H5Gclose);
  if (!g.valid()) state_->fail(fmt::format("no group '{}' in it", group));
  std::vector<std::string> names;
  auto collect = [](hid_t, const char* name, const H5L_info_t*, void* out) -> herr_t {
    static_cast<std::vector<std::string>*>(out)->emplace_back(name);
    return 0;
  };
  hsize_t at = 0;
  // In the file's own order: for another one HDF5 1.10.8 makes a table as long as a damaged file says, and frees what is not in it.
  if (H5Literate(g, H5_INDEX_NAME, H5_ITER_NATIVE, &at, collect, &names) < 0)
    state_->fail(fmt::format("cannot list the group '{}'", group));
  std::sort(names.begin(), names.end());
  return names;
}

void Hdf5File::create_group(const std::string& path) {
  const Guard guard(library_lock());
  state_->need_layout("create a group");
  const Handle lcpl(H5Pcreate(H5P_LINK_CREATE), H5Pclose);
  H5Pset_create_intermediate_group(lcpl, 1);
  const Handle g(H5Gcreate2(state_->file, path.c_str(), lcpl, H5P_DEFAULT, H5P_DEFAULT), H5Gclose);
  if (!g.valid()) state_->fail(fmt::format("cannot create the group '{}'", path));
}

void Hdf5File::remove(const std::string& path) {
  const Guard guard(library_lock());
  state_->need_layout("remove an object");
  state_->open_arrays.clear();
  if (H5Ldelete(state_->file, path.c_str(), H5P_DEFAULT) < 0) state_->fail(fmt::format("cannot remove '{}'", path));
}

template <typename T>
void Hdf5File::write_grid(const std::string& path, std::span<const T> values, const std::vector<std::size_t>& shape,
                          const ArrayOptions& options) {
  const Guard guard(library_lock());
  state_->need_layout("create an array");
  if (shape.empty() || shape.size() > kMaxRank || product(shape) != values.size())
    throw RunError(fmt::format("{}: '{}': {} values do not fill the shape given", state_->path, path, values.size()));
  const std::vector<hsize_t> dims(shape.begin(), shape.end());
  std::vector<hsize_t> limits = dims;
  if (options.extendible) limits[0] = H5S_UNLIMITED;
  const int rank = static_cast<int>(dims.size());
  const Handle space(H5Screate_simple(rank, dims.data(), limits.data()), H5Sclose);
  const Handle dcpl(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  const std::size_t row = product(shape, 1);
  // An empty array cannot be chunked unless it may grow, nor need it be.
  const bool chunked = options.extendible || (options.compression > 0 && !values.empty());
  if (chunked) {
    std::vector<hsize_t> chunk = dims;
    const std::size_t row_bytes = std::max<std::size_t>(row, 1) * sizeof(T);
    chunk[0] = options.chunk_rows > 0 ? options.chunk_rows : std::max<std::size_t>(kChunkBytes / row_bytes, 1);
    if (!options.extendible) chunk[0] = std::min(chunk[0], dims[0]);
    for (hsize_t& c : chunk) c = std::max<hsize_t>(c, 1);
    H5Pset_chunk(dcpl, rank, chunk.data());
    if (options.compression > 0) {
      H5Pset_shuffle(dcpl);
      H5Pset_deflate(dcpl, static_cast<unsigned>(std::clamp(options.compression, 1, 9)));
    }
  }
  const Handle lcpl(H5Pcreate(H5P_LINK_CREATE), H5Pclose);
  H5Pset_create_intermediate_group(lcpl, 1);
  const hid_t stored = options.keep_float && std::is_same_v<T, double> ? H5T_NATIVE_FLOAT : native_type<T>();
  const Handle array(H5Dcreate2(state_->file, path.c_str(), stored, space, lcpl, dcpl, H5P_DEFAULT), H5Dclose);
  if (!array.valid()) state_->fail(fmt::format("cannot create the array '{}'", path));
  if (!values.empty() && H5Dwrite(array, native_type<T>(), H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) < 0)
    state_->fail(fmt::format("cannot write the array '{}'", path));
}

template <typename T>
void Hdf5File::append(const std::string& path, std::span<const T> values) {
  const Guard guard(library_lock());
  State& s = *state_;
  s.need_open();
  auto found = std::find_if(s.open_arrays.begin(), s.open_arrays.end(), [&](const auto& o) { return o.path == path; });
  if (found == s.open_arrays.end()) {
    State::Open open{path, s.open_array(path), {}};
    const auto dims = s.shape_of(open.array);
    open.shape.assign(dims.begin(), dims.end());
    if (open.shape.empty()) throw RunError(fmt::format("{}: '{}' is a single value, not an array", s.path, path));
    s.open_arrays.push_back(std::move(open));
    found = s.open_arrays.end() - 1;
  }
  std::size_t row = 1;
  for (std::size_t i = 1; i < found->shape.size(); ++i) row *= found->shape[i];
  if (row == 0 || values.size() % row != 0)
    throw RunError(fmt::format("{}: '{}': {} values are not whole rows of {}", s.path, path, values.size(), row));
  if (values.empty()) return;
  std::vector<hsize_t> start(found->shape.size(), 0), count = found->shape, whole = found->shape;
  start[0] = found->shape[0];
  count[0] = values.size() / row;
  whole[0] += count[0];
  if (H5Dset_extent(found->array, whole.data()) < 0) s.fail(fmt::format("cannot extend the array '{}'", path));
  found->shape = whole;
  const Handle space(H5Dget_space(found->array), H5Sclose);
  const Handle memory(H5Screate_simple(static_cast<int>(count.size()), count.data(), nullptr), H5Sclose);
  H5Sselect_hyperslab(space, H5S_SELECT_SET, start.data(), nullptr, count.data(), nullptr);
  if (H5Dwrite(found->array, native_type<T>(), memory, space, H5P_DEFAULT, values.data()) < 0)
    s.fail(fmt::format("cannot append to the array '{}'", path));
}

std::vector<std::size_t> Hdf5File::shape(const std::string& path) const {
  const Guard guard(library_lock());
  return state_->shape_of(state_->open_array(path));
}

bool Hdf5File::is_numeric(const std::string& path) const {
  const Guard guard(library_lock());
  const Handle array = state_->open_array(path);
  const Handle type(H5Dget_type(array), H5Tclose);
  const H5T_class_t c = H5Tget_class(type);
  return c == H5T_INTEGER || c == H5T_FLOAT;
}

template <typename T>
Array<T> Hdf5File::read(const std::string& path) const {
  return read_rows<T>(path, 0, std::numeric_limits<std::size_t>::max());
}

template <typename T>
Array<T> Hdf5File::read_rows(const std::string& path, std::size_t first, std::size_t count) const {
  const Guard guard(library_lock());
  if (!is_numeric(path)) throw RunError(fmt::format("{}: '{}' does not hold numbers", state_->path, path));
  const Handle array = state_->open_array(path);
  Array<T> out;
  out.shape = state_->shape_of(array);
  const Handle space(H5Dget_space(array), H5Sclose);
  if (out.shape.empty()) {  // a single value
    out.shape = {1};
    out.values.resize(1);
    if (H5Dread(array, native_type<T>(), H5S_ALL, H5S_ALL, H5P_DEFAULT, out.values.data()) < 0)
      state_->fail(fmt::format("cannot read '{}'", path));
    return out;
  }
  first = std::min(first, out.shape[0]);
  out.shape[0] = std::min(count, out.shape[0] - first);
  state_->need_storable(out.shape, sizeof(T), path);
  out.values.resize(product(out.shape));
  if (out.values.empty()) return out;
  std::vector<hsize_t> start(out.shape.size(), 0), extent(out.shape.begin(), out.shape.end());
  start[0] = first;
  const Handle memory(H5Screate_simple(static_cast<int>(extent.size()), extent.data(), nullptr), H5Sclose);
  H5Sselect_hyperslab(space, H5S_SELECT_SET, start.data(), nullptr, extent.data(), nullptr);
  if (H5Dread(array, native_type<T>(), memory, space, H5P_DEFAULT, out.values.data()) < 0)
    state_->fail(fmt::format("cannot read the array '{}'", path));
  return out;
}

void Hdf5File::write_text(const std::string& path, const std::vector<std::string>& values) {
  const Guard guard(library_lock());
  state_->need_layout("create an array");
  std::size_t size = 1;
  for (const std::string& v : values) size = std::max(size, v.size());
  std::string raw(size * values.size(), '\0');
  for (std::size_t i = 0; i < values.size(); ++i) raw.replace(i * size, values[i].size(), values[i]);
  const Handle type = text_type(size);
  const hsize_t count = values.size();
  const Handle space(H5Screate_simple(1, &count, nullptr), H5Sclose);
  const Handle lcpl(H5Pcreate(H5P_LINK_CREATE), H5Pclose);
  H5Pset_create_intermediate_group(lcpl, 1);
  const Handle array(H5Dcreate2(state_->file, path.c_str(), type, space, lcpl, H5P_DEFAULT, H5P_DEFAULT), H5Dclose);
  if (!array.valid() || (!raw.empty() && H5Dwrite(array, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, raw.data()) < 0))
    state_->fail(fmt::format("cannot write the text '{}'", path));
}

std::vector<std::string> Hdf5File::read_text(const std::string& path) const {
  const Guard guard(library_lock());
  const Handle array = state_->open_array(path);
  const Handle type(H5Dget_type(array), H5Tclose);
  if (H5Tget_class(type) != H5T_STRING) throw RunError(fmt::format("{}: '{}' does not hold text", state_->path, path));
  return state_->read_strings(array, false);
}

void Hdf5File::set_attribute(const std::string& path, const std::string& name, const std::string& value) {
  const Guard guard(library_lock());
  const Handle type = text_type(value.size());
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  const std::string padded = value.empty() ? std::string(1, '\0') : value;
  state_->replace_attribute(path, name, type, space, padded.data());
}

void Hdf5File::set_attribute(const std::string& path, const std::string& name, const char* value) {
  set_attribute(path, name, std::string(value));
}

void Hdf5File::set_attribute(const std::string& path, const std::string& name, double value) {
  const Guard guard(library_lock());
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  state_->replace_attribute(path, name, H5T_NATIVE_DOUBLE, space, &value);
}

void Hdf5File::set_attribute(const std::string& path, const std::string& name, std::int64_t value) {
  const Guard guard(library_lock());
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  state_->replace_attribute(path, name, H5T_NATIVE_INT64, space, &value);
}

void Hdf5File::set_attribute(const std::string& path, const std::string& name, int value) {
  set_attribute(path, name, static_cast<std::int64_t>(value));
}

void Hdf5File::set_attribute(const std::string& path, const std::string& name, const std::vector<double>& value) {
  const Guard guard(library_lock());
  const hsize_t count = value.size();
  const Handle space(H5Screate_simple(1, &count, nullptr), H5Sclose);
  const double none = 0.0;
  state_->replace_attribute(path, name, H5T_NATIVE_DOUBLE, space, value.empty() ? &none : value.data());
}

std::vector<std::string> Hdf5File::attributes(const std::string& path) const {
  const Guard guard(library_lock());
  const Handle o = state_->open_object(path);
  std::vector<std::string> names;
  auto collect = [](hid_t, const char* name, const H5A_info_t*, void* out) -> herr_t {
    static_cast<std::vector<std::string>*>(out)->emplace_back(name);
    return 0;
  };
  hsize_t at = 0;
  if (H5Aiterate2(o, H5_INDEX_NAME, H5_ITER_NATIVE, &at, collect, &names) < 0)
    state_->fail(fmt::format("cannot list the attributes of '{}'", path));
  std::sort(names.begin(), names.end());
  return names;
}

std::optional<std::string> Hdf5File::text_attribute(const std::string& path, const std::string& name) const {
  const Guard guard(library_lock());
  const Handle a = state_->find_attribute(path, name);
  if (!a.valid()) return std::nullopt;
  const Handle type(H5Aget_type(a), H5Tclose);
  if (H5Tget_class(type) != H5T_STRING) return std::nullopt;
  const auto values = state_->read_strings(a, true);
  return values.empty() ? std::string() : values.front();
}

std::optional<double> Hdf5File::number_attribute(const std::string& path, const std::string& name) const {
  const auto values = numbers_attribute(path, name);
  if (!values || values->size() != 1) return std::nullopt;
  return values->front();
}

std::optional<std::vector<double>> Hdf5File::numbers_attribute(const std::string& path, const std::string& name) const {
  const Guard guard(library_lock());
  const Handle a = state_->find_attribute(path, name);
  if (!a.valid()) return std::nullopt;
  const Handle type(H5Aget_type(a), H5Tclose);
  const H5T_class_t c = H5Tget_class(type);
  if (c != H5T_INTEGER && c != H5T_FLOAT) return std::nullopt;
  const Handle space(H5Aget_space(a), H5Sclose);
  const hssize_t count = H5Sget_simple_extent_npoints(space);
  if (count < 0) return std::nullopt;
  state_->need_storable({static_cast<std::size_t>(count)}, sizeof(double), name);
  std::vector<double> out(static_cast<std::size_t>(count));
  if (!out.empty() && H5Aread(a, H5T_NATIVE_DOUBLE, out.data()) < 0) return std::nullopt;
  return out;
}

#define TERRODE_INSTANTIATE(T)                                                                                     \
  template void Hdf5File::write_grid<T>(const std::string&, std::span<const T>, const std::vector<std::size_t>&,   \
                                        const ArrayOptions&);                                                      \
  template void Hdf5File::append<T>(const std::string&, std::span<const T>);                                       \
  template Array<T> Hdf5File::read<T>(const std::string&) const;                                                   \
  template Array<T> Hdf5File::read_rows<T>(const std::string&, std::size_t, std::size_t) const;
TERRODE_INSTANTIATE(double)
TERRODE_INSTANTIATE(float)
TERRODE_INSTANTIATE(int)
TERRODE_INSTANTIATE(std::int64_t)
TERRODE_INSTANTIATE(std::uint8_t)
#undef TERRODE_INSTANTIATE

namespace {

// Asks the system to put a file or folder on the disk. Throws RunError where the disk says no; file systems that cannot
// sync (EINVAL) are let be.
void sync_to_disk(const std::string& path, int flags) {
  const int fd = ::open(path.c_str(), flags);
  if (fd < 0) return;
  const bool failed = ::fsync(fd) != 0 && errno != EINVAL;
  const int error = errno;
  ::close(fd);
  if (failed) throw RunError(fmt::format("{}: cannot write to disk: {}", path, system_error_text(error)));
}

// Removes what killed writers left beside `path`: parts of processes that are no more, untouched for a minute (a writer
// on another machine touches its part more often).
void clear_left_parts(const std::string& path) {
  namespace fs = std::filesystem;
  std::error_code error;
  const fs::path whole = fs::absolute(path, error);
  const std::string prefix = whole.filename().string() + ".part";
  for (const auto& entry : fs::directory_iterator(whole.parent_path(), error)) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with(prefix) || name.size() == prefix.size() || name.size() > prefix.size() + 9) continue;
    const std::string digits = name.substr(prefix.size());
    if (digits.find_first_not_of("0123456789") != std::string::npos) continue;
    std::error_code ignored;
    const auto age = fs::file_time_type::clock::now() - entry.last_write_time(ignored);
    if (ignored || age < std::chrono::minutes(1)) continue;
    if (::kill(static_cast<pid_t>(std::stol(digits)), 0) != 0 && errno == ESRCH) fs::remove(entry.path(), ignored);
  }
}

}  // namespace

void write_atomically(const std::string& path, bool keep, const std::function<void(Hdf5File&)>& write) {
  clear_left_parts(path);
  const std::string part = fmt::format("{}.part{}", path, ::getpid());
  std::error_code error;
  const bool copy = keep && std::filesystem::exists(path, error);
  if (copy) {
    std::filesystem::copy_file(path, part, std::filesystem::copy_options::overwrite_existing, error);
    if (error) {
      std::error_code ignored;
      std::filesystem::remove(part, ignored);
      throw RunError(fmt::format("{}: cannot be copied: {}", path, error.message()));
    }
  }
  try {
    Hdf5File file = copy ? Hdf5File::open_for_writing(part) : Hdf5File::create(part);
    write(file);
    file.close();
    sync_to_disk(part, O_RDONLY);  // closing wrote the file's head
    std::filesystem::rename(part, path, error);
    if (error) throw RunError(fmt::format("{}: cannot be replaced: {}", path, error.message()));
  } catch (...) {
    std::filesystem::remove(part, error);
    throw;
  }
  // The rename itself is on disk once the folder is.
  sync_to_disk(std::filesystem::absolute(path).parent_path().string(), O_RDONLY | O_DIRECTORY);
}

}  // namespace terrode::recording
