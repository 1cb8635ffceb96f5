#include "recording/mat_check.h"

#include <fmt/format.h>
#include <hdf5.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <fstream>
#include <mutex>
#include <string_view>
#include <vector>

#include "core/problem.h"
#include "recording/hdf5_file.h"
#include "recording/hdf5_lock.h"

namespace terrode::recording {
namespace {

constexpr std::uint64_t kMaxBytes = std::uint64_t{1} << 30;  // of all values, as doubles
constexpr std::uint64_t kMaxElements = 100'000;
constexpr int kMaxDepth = 16;
constexpr std::uint32_t kMaxName = 4096;

struct Budget {
  std::string path;
  std::uint64_t bytes = 0, elements = 0;

  [[noreturn]] void refuse(const std::string& what, const std::string& expected = {}) const {
    throw InputError(Problem{path, 0, 0, {}, "is not a sound MATLAB file: " + what, expected});
  }
  // So many more values, each of which will be a double.
  void add_values(std::uint64_t count) {
    if (count > kMaxBytes / 8 || (bytes += 8 * count) > kMaxBytes)
      throw InputError(Problem{path, 0, 0, {}, "holds too many values", fmt::format("at most {} in all its variables", kMaxBytes / 8)});
  }
  void add_element(int depth) {
    if (depth > kMaxDepth) refuse(fmt::format("structures deeper than {}", kMaxDepth));
    if (++elements > kMaxElements)
      throw InputError(Problem{path, 0, 0, {}, "holds too many elements", fmt::format("at most {}", kMaxElements)});
  }
};

// Bytes in their order, from the file or from what a part of it unpacks to.
class Source {
 public:
  virtual ~Source() = default;
  virtual bool read(void* to, std::size_t count) = 0;
  bool skip(std::uint64_t count) {
    std::array<char, 65536> some;
    while (count > 0) {
      const auto n = static_cast<std::size_t>(std::min<std::uint64_t>(count, some.size()));
      if (!read(some.data(), n)) return false;
      count -= n;
    }
    return true;
  }
};

class FileSource final : public Source {
 public:
  explicit FileSource(const std::string& path) : in_(path, std::ios::binary) {}
  bool read(void* to, std::size_t count) override {
    return static_cast<bool>(in_.read(static_cast<char*>(to), static_cast<std::streamsize>(count)));
  }
  bool ends() { return in_.peek() == std::ifstream::traits_type::eof(); }

 private:
  std::ifstream in_;
};

class Inflated final : public Source {
 public:
  Inflated(Source& from, std::uint64_t bytes) : from_(from), left_(bytes) { ready_ = inflateInit(&stream_) == Z_OK; }
  Inflated(const Inflated&) = delete;
  Inflated& operator=(const Inflated&) = delete;
  ~Inflated() override {
    if (ready_) inflateEnd(&stream_);
  }
  bool read(void* to, std::size_t count) override {
    stream_.next_out = static_cast<Bytef*>(to);
    stream_.avail_out = static_cast<uInt>(count);
    while (ready_ && stream_.avail_out > 0) {
      if (stream_.avail_in == 0 && left_ > 0) {
        const auto n = static_cast<std::size_t>(std::min<std::uint64_t>(left_, packed_.size()));
        if (!from_.read(packed_.data(), n)) return false;
        left_ -= n;
        stream_.next_in = packed_.data();
        stream_.avail_in = static_cast<uInt>(n);
      }
      const int status = inflate(&stream_, Z_NO_FLUSH);
      if (status != Z_OK && (status != Z_STREAM_END || stream_.avail_out > 0)) return false;
    }
    return ready_;
  }
  // Leaves the source behind the packed bytes.
  bool skip_rest() { return from_.skip(left_); }

 private:
  Source& from_;
  std::uint64_t left_;
  z_stream stream_{};
  bool ready_ = false;
  std::array<Bytef, 16384> packed_;
};

enum Type : std::uint32_t { kInt8 = 1, kUInt8 = 2, kInt32 = 5, kUInt32 = 6, kMatrix = 14, kCompressed = 15 };
enum Class : std::uint32_t { kCell = 1, kStruct = 2, kObject = 3, kChar = 4, kSparse = 5, kDouble = 6, kUInt64 = 15, kFunction = 16, kOpaque = 17 };

// Bytes of one value of a stored type; 0 for what is no type of numbers or text.
std::uint32_t size_of(std::uint32_t type) {
  switch (type) {
    case 1: case 2: case 16: return 1;
    case 3: case 4: case 17: return 2;
    case 5: case 6: case 7: case 18: return 4;
    case 9: case 12: case 13: return 8;
    default: return 0;
  }
}

class Walk {
 public:
  Walk(Budget& budget, bool swap) : budget_(budget), swap_(swap) {}

  void variables(FileSource& file) {
    while (!file.ends()) {
      std::uint64_t left = ~std::uint64_t{0};
      const Tag tag = read_tag(file, left);
      if (tag.in_tag) budget_.refuse("a variable of at most four bytes");
      if (tag.type == kCompressed) {
        Inflated inside(file, tag.bytes);
        std::uint64_t unpacked = ~std::uint64_t{0};
        const Tag inner = read_tag(inside, unpacked);
        if (inner.type != kMatrix || inner.in_tag) budget_.refuse("something packed that is no variable");
        array(inside, inner.bytes, 0, true, true);
        if (!inside.skip_rest()) cut_short();
      } else if (tag.type == kMatrix) {
        array(file, tag.bytes, 0, true, false);
      } else {
        budget_.refuse(fmt::format("an element of type {}", tag.type), "a variable");
      }
    }
  }

 private:
  struct Tag {
    std::uint32_t type = 0, bytes = 0;
    bool in_tag = false;  // the values stand in the tag's last four bytes
    std::array<char, 4> data{};
  };

  [[noreturn]] void cut_short() const { budget_.refuse("it ends in the middle of a variable"); }
  std::uint32_t number(const char* at) const {
    std::uint32_t x = 0;
    std::copy_n(at, 4, reinterpret_cast<char*>(&x));
    return swap_ ? __builtin_bswap32(x) : x;
  }
  void take(std::uint64_t& left, std::uint64_t bytes) const {
    if (bytes > left) budget_.refuse("an element longer than the one that holds it");
    left -= bytes;
  }
  Tag read_tag(Source& from, std::uint64_t& left) const {
    std::array<char, 8> raw;
    take(left, raw.size());
    if (!from.read(raw.data(), raw.size())) cut_short();
    const std::uint32_t first = number(raw.data());
    Tag tag;
    tag.in_tag = (first >> 16) != 0;
    tag.type = tag.in_tag ? first & 0xffffu : first;
    tag.bytes = tag.in_tag ? first >> 16 : number(raw.data() + 4);
    std::copy_n(raw.data() + 4, 4, tag.data.data());
    if (tag.in_tag && tag.bytes > 4) budget_.refuse("more than four bytes in a tag");
    return tag;
  }
  static std::uint64_t padded(std::uint64_t bytes) { return (bytes + 7) / 8 * 8; }
  void skip(Source& from, const Tag& tag, std::uint64_t& left) const {
    if (tag.in_tag) return;
    take(left, padded(tag.bytes));
    if (!from.skip(padded(tag.bytes))) cut_short();
  }
  std::vector<char> read(Source& from, const Tag& tag, std::uint64_t& left) const {
    if (tag.in_tag) return {tag.data.begin(), tag.data.begin() + tag.bytes};
    std::vector<char> out(padded(tag.bytes));
    take(left, out.size());
    if (!from.read(out.data(), out.size())) cut_short();
    out.resize(tag.bytes);
    return out;
  }

  // How many elements a variable says it has; of one that is passed over (a sparse matrix may be of any size) any number.
  std::uint64_t dimensions(Source& from, std::uint64_t& left, bool passed_over) const {
    const Tag shape = read_tag(from, left);
    if (shape.in_tag || shape.type != kInt32 || shape.bytes % 4 != 0 || shape.bytes < 8 || shape.bytes > 4 * 13)
      budget_.refuse("a variable without dimensions", "2 to 13 of them");
    const std::vector<char> dims = read(from, shape, left);
    if (passed_over) return 0;
    std::uint64_t count = 1;
    bool empty = false;
    for (std::size_t i = 0; i < dims.size(); i += 4) {
      const std::uint64_t n = number(dims.data() + i);
      empty = empty || n == 0;
      if (n != 0 && (n >> 31 || count > (std::uint64_t{1} << 32) / n)) budget_.refuse("dimensions beyond any file");
      count *= n == 0 ? 1 : n;
    }
    return empty ? 0 : count;
  }

  // An array of `left` bytes after its tag. Within a cell or structure it may be empty.
  void array(Source& from, std::uint64_t left, int depth, bool top, bool packed) {
    budget_.add_element(depth);
    if (left == 0 && !top) return;
    const Tag flags = read_tag(from, left);
    if (flags.in_tag || flags.bytes != 8 || (flags.type != kUInt32 && flags.type != kInt32)) budget_.refuse("a variable without its kind");
    const std::uint32_t word = number(read(from, flags, left).data());
    const std::uint32_t kind = word & 0xffu;
    const bool complex = (word & 0x800u) != 0;
    const bool known = kind == kCell || kind == kStruct || kind == kChar || (kind >= kDouble && kind <= kUInt64);
    if (!known) {
      if (kind != kObject && kind != kSparse && kind != kFunction && kind != kOpaque) budget_.refuse(fmt::format("a variable of kind {}", kind));
      if (!top) budget_.refuse("an object, function or sparse matrix within a structure", "numbers, text and structures");
      if (kind == kOpaque && flags.type != kUInt32) budget_.refuse("a variable without its kind");  // the library would look for dimensions
      if (kind == kFunction && !packed) budget_.refuse("a function, not packed");
    }
    const std::uint64_t count = kind == kOpaque ? 0 : dimensions(from, left, !known);

    const Tag name = read_tag(from, left);
    if (name.type != kInt8 || name.bytes > kMaxName) budget_.refuse("a variable without a name");
    skip(from, name, left);

    if (!known) {  // the library reads no more of these, and passes over the rest
      if (!from.skip(left)) cut_short();
      return;
    }
    if (kind == kCell) {
      children(from, left, count, depth, packed);
    } else if (kind == kStruct) {
      const Tag length = read_tag(from, left);
      const std::uint32_t width = number(length.data.data());
      if (!length.in_tag || length.type != kInt32 || length.bytes != 4 || width == 0 || width > kMaxName)
        budget_.refuse("a structure without the length of its fields' names");
      const Tag names = read_tag(from, left);
      if (names.type != kInt8 || names.bytes % width != 0 || (names.in_tag && names.bytes != 0)) budget_.refuse("a structure without its fields' names");
      skip(from, names, left);
      const std::uint64_t fields = names.bytes / width;
      if (fields != 0 && count > kMaxElements / fields) budget_.refuse("a structure of too many elements");
      children(from, left, count * fields, depth, packed);
    } else {
      for (int part = 0; part < (complex ? 2 : 1); ++part) {
        const Tag values = read_tag(from, left);
        const std::uint64_t size = size_of(values.type), stored = values.bytes;
        const bool text = kind == kChar;
        const bool fits = values.type == 16 && text ? stored >= count && stored <= 4 * count : size != 0 && stored == size * count;
        if (!fits) budget_.refuse(fmt::format("a variable of {} values with {} bytes of type {}", count, stored, values.type));
        budget_.add_values(std::max(count, stored / 8));
        skip(from, values, left);
      }
    }
    if (left != 0) budget_.refuse("a variable longer than its values");
  }

  void children(Source& from, std::uint64_t& left, std::uint64_t count, int depth, bool packed) {
    if (count > left / 8) budget_.refuse("a structure or cell array of more elements than it has bytes");
    for (std::uint64_t i = 0; i < count; ++i) {
      const Tag tag = read_tag(from, left);
      if (tag.type != kMatrix || tag.in_tag) budget_.refuse("something within a structure that is no array");
      take(left, tag.bytes);
      array(from, tag.bytes, depth + 1, false, packed);
    }
  }

  Budget& budget_;
  bool swap_;
};

// The same for a file that is HDF5 inside: elements of cell arrays are reached by references, as the library reaches them.
class HdfWalk {
 public:
  HdfWalk(Budget& budget, std::uint64_t file_bytes) : budget_(budget), file_bytes_(file_bytes) {}

  void group(hid_t at, int depth) {
    std::vector<std::string> names;
    const auto keep = [](hid_t, const char* name, const H5L_info_t* link, void* out) -> herr_t {
      auto& all = *static_cast<std::vector<std::string>*>(out);
      if (link->type != H5L_TYPE_HARD || all.size() > kMaxElements) return -1;
      all.emplace_back(name);
      return 0;
    };
    if (H5Literate(at, H5_INDEX_NAME, H5_ITER_NATIVE, nullptr, keep, &names) < 0) budget_.refuse("a group with links that lead elsewhere or cannot be read");
    for (const std::string& name : names) object(H5Oopen(at, name.c_str(), H5P_DEFAULT), depth + 1);
  }

 private:
  // Takes the handle.
  void object(hid_t id, int depth) {
    if (id < 0) budget_.refuse("an object that cannot be opened");
    const Closed closed{id};
    budget_.add_element(depth);
    const H5I_type_t kind = H5Iget_type(id);
    if (kind == H5I_GROUP) group(id, depth);
    if (kind == H5I_DATASET) array(id, depth);
  }
  void array(hid_t id, int depth) {
    const hid_t space = H5Dget_space(id), type = H5Dget_type(id), plan = H5Dget_create_plist(id);
    const Closed closed_space{space}, closed_type{type}, closed_plan{plan};
    const hssize_t points = space < 0 ? -1 : H5Sget_simple_extent_npoints(space);
    const std::uint64_t size = type < 0 ? 0 : H5Tget_size(type);
    if (points < 0 || size == 0 || plan < 0) budget_.refuse("an array that cannot be read");
    if (H5Pget_external_count(plan) > 0 || H5Pget_layout(plan) == H5D_VIRTUAL) budget_.refuse("an array that lies in another file");
    const auto count = static_cast<std::uint64_t>(points);
    budget_.add_values(count);
    if (size > 8) budget_.add_values(count > kMaxBytes / size ? kMaxBytes : count * (size / 8));
    if (!could_be_stored(count, size, file_bytes_)) budget_.refuse(fmt::format("an array of {} values, more than its bytes can hold", count));
    if (H5Tget_class(type) != H5T_REFERENCE) return;
    if (count > kMaxElements || size != sizeof(hobj_ref_t)) budget_.refuse("too many references");
    std::vector<hobj_ref_t> references(count);
    if (count == 0) return;
    if (H5Dread(id, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, references.data()) < 0) budget_.refuse("references that cannot be read");
    for (const hobj_ref_t& reference : references)
      if (reference != 0) object(H5Rdereference2(id, H5P_DEFAULT, H5R_OBJECT, &reference), depth + 1);
  }

  struct Closed {
    hid_t id;
    ~Closed() {
      if (id >= 0) H5Idec_ref(id);
    }
  };
  Budget& budget_;
  std::uint64_t file_bytes_;
};

}  // namespace

void check_mat_file(const std::string& path) {
  Budget budget{path};
  FileSource file(path);
  std::array<char, 128> header;
  const Problem none{path, 0, 0, {}, "is not a MATLAB file of version 5 to 7.3", "one saved with -v6, -v7 or -v7.3"};
  if (!file.read(header.data(), header.size())) throw InputError(none);
  const std::string_view order(header.data() + 126, 2);
  if (order != "IM" && order != "MI") throw InputError(none);
  const bool swap = (order == "IM") != (std::endian::native == std::endian::little);
  const unsigned low = static_cast<unsigned char>(header[124]), high = static_cast<unsigned char>(header[125]);
  const unsigned version = order == "IM" ? low | high << 8u : high | low << 8u;
  if (version == 0x0100) return Walk(budget, swap).variables(file);
  if (version != 0x0200) throw InputError(none);

  const std::lock_guard<std::recursive_mutex> guard(hdf5_lock());
  Hdf5File::open(path);  // says what is wrong where it is none
  const hid_t id = H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  if (id < 0) throw InputError(none);
  hsize_t bytes = 0;
  H5Fget_filesize(id, &bytes);
  try {
    HdfWalk(budget, bytes).group(id, 0);
  } catch (...) {
    H5Fclose(id);
    throw;
  }
  H5Fclose(id);
}

}  // namespace terrode::recording
