// HDF5 files: groups, arrays and attributes, owned by RAII, errors as exceptions. No HDF5 type is seen outside.
//
// Paths inside a file are absolute ("/run/time"); missing parent groups are made on writing. Arrays are row-major with
// rank 1 to 4. Text is UTF-8. One process-wide lock guards the library, so that files may be used from any thread.
//
// Crash safety. Two ways, for two kinds of result:
// - A file that grows in time (a run): lay out every array and attribute, call start_appending(), then append() and
//   flush(). This is HDF5's single-writer mode (SWMR): its metadata reaches the disk in an order that leaves the file
//   readable at every moment, for a reader that looks on and after a kill in the middle of a write, up to the last
//   flush. open() reads a file that such a writer left behind.
// - A file that gains groups piece by piece (a sweep): write_atomically() writes a copy beside it, syncs it to disk and
//   renames it over the old one, so that each moment has a whole file. SWMR cannot create objects, and flushing an
//   ordinary HDF5 file is not atomic: a kill during the flush may leave it unreadable.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/problem.h"

namespace terrode::recording {

// How an array is stored. Chunked storage is used where `extendible` or `compression` asks for it.
struct ArrayOptions {
  int compression = 0;             // 0: none; 1 (fast) to 9 (small): shuffle and deflate
  bool extendible = false;         // first dimension may grow by append()
  std::size_t chunk_rows = 0;      // rows (first dimension) in a chunk; 0: about 64 KiB worth
  bool keep_float = false;         // store doubles as 32-bit floats on disk (7 digits)
};

// A row-major array read from a file.
template <typename T>
struct Array {
  std::vector<std::size_t> shape;
  std::vector<T> values;
};

class Hdf5File {
 public:
  // Creates a file (replacing one that is there). Throws RunError where it cannot be created.
  static Hdf5File create(const std::string& path);
  // Opens for reading, also one that a killed or running appending writer left. Throws InputError where it is missing
  // or is no HDF5 file.
  static Hdf5File open(const std::string& path);
  // Opens for reading and writing. Throws like open(), and RunError where another process has it open.
  static Hdf5File open_for_writing(const std::string& path);

  Hdf5File(Hdf5File&&) noexcept;
  Hdf5File& operator=(Hdf5File&&) noexcept;
  ~Hdf5File();  // closes; errors are lost there, so call close() where they matter

  const std::string& path() const;
  // Writes what is buffered to the operating system and asks it to put it on the disk. Throws RunError.
  void flush();
  // Flushes and closes. Throws RunError (a full disk shows here at the latest). Further calls throw.
  void close();
  // Ends laying out: from here on only append() and flush(). See "Crash safety" above.
  void start_appending();

  bool exists(const std::string& path) const;
  bool is_group(const std::string& path) const;
  bool is_array(const std::string& path) const;
  // Names of the members of a group, in alphabetical order. Throws RunError where the group is missing.
  std::vector<std::string> children(const std::string& group) const;
  void create_group(const std::string& path);
  // Removes a group with all it holds, or an array.
  void remove(const std::string& path);

  // Writes a new array of any shape, or of rank 1. T is double, float, int, std::int64_t or std::uint8_t. The product of `shape` must be the
  // number of values. With `extendible` the first dimension may be 0 to begin with. Throws RunError.
  template <typename T>
  void write_grid(const std::string& path, std::span<const T> values, const std::vector<std::size_t>& shape,
                  const ArrayOptions& options = {});
  template <typename T>
  void write_grid(const std::string& path, const std::vector<T>& values, const std::vector<std::size_t>& shape,
                  const ArrayOptions& options = {}) {
    write_grid(path, std::span<const T>(values), shape, options);
  }
  template <typename T>
  void write(const std::string& path, const std::vector<T>& values, const ArrayOptions& options = {}) {
    write_grid(path, std::span<const T>(values), {values.size()}, options);
  }
  // Adds whole rows (values.size() a multiple of the row size) at the end of an extendible array. Throws RunError.
  template <typename T>
  void append(const std::string& path, std::span<const T> values);
  template <typename T>
  void append(const std::string& path, const std::vector<T>& values) {
    append(path, std::span<const T>(values));
  }
  // Rows in an array, or its whole shape. Throws RunError where it is missing.
  std::vector<std::size_t> shape(const std::string& path) const;
  // True if the values of an array are integers or floating-point numbers.
  bool is_numeric(const std::string& path) const;
  // Reads a whole numeric array, converted to T from what is stored. Throws RunError.
  template <typename T>
  Array<T> read(const std::string& path) const;
  // Reads rows [first, first + count) of it.
  template <typename T>
  Array<T> read_rows(const std::string& path, std::size_t first, std::size_t count) const;

  // One-dimensional arrays of text.
  void write_text(const std::string& path, const std::vector<std::string>& values);
  std::vector<std::string> read_text(const std::string& path) const;

  // Attributes of a group or an array ("/" for the file); an attribute that is there is replaced.
  void set_attribute(const std::string& path, const std::string& name, const std::string& value);
  void set_attribute(const std::string& path, const std::string& name, const char* value);
  void set_attribute(const std::string& path, const std::string& name, double value);
  void set_attribute(const std::string& path, const std::string& name, std::int64_t value);
  void set_attribute(const std::string& path, const std::string& name, int value);
  void set_attribute(const std::string& path, const std::string& name, const std::vector<double>& value);
  std::vector<std::string> attributes(const std::string& path) const;
  // The attribute's value, or nothing where it is missing or of another kind.
  std::optional<std::string> text_attribute(const std::string& path, const std::string& name) const;
  std::optional<double> number_attribute(const std::string& path, const std::string& name) const;
  std::optional<std::vector<double>> numbers_attribute(const std::string& path, const std::string& name) const;

 private:
  struct State;
  explicit Hdf5File(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

// Calls `write` on a file beside `path`, then syncs it to disk and renames it to `path` in one step; with `keep` the
// new file begins as a copy of what is at `path`, if anything is. Where `write` throws, `path` is as it was.
// Throws RunError (no space, no permission) and whatever `write` throws.
void write_atomically(const std::string& path, bool keep, const std::function<void(Hdf5File&)>& write);

}  // namespace terrode::recording
