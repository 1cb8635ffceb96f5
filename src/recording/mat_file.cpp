#include "recording/mat_file.h"

#include <fmt/format.h>
#include <matio.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>
#include <vector>

#include "recording/gap.h"
#include "recording/hdf5_lock.h"
#include "recording/mat_check.h"

namespace terrode::recording {
namespace {

struct MatCloser {
  void operator()(mat_t* m) const { Mat_Close(m); }
};
struct VarFreer {
  void operator()(matvar_t* v) const { Mat_VarFree(v); }
};

constexpr std::size_t kMaxColumns = 4096;

// The library's messages end up in the exception, not on the terminal.
std::string& library_message() {
  static std::string text;
  return text;
}
void keep_message(int, char* message) {
  if (message) library_message() = message;
}

bool numeric(const matvar_t& v) {
  return v.class_type >= MAT_C_DOUBLE && v.class_type <= MAT_C_UINT64 && v.isComplex == 0 && v.data != nullptr;
}

// Sparse matrices, objects, functions and cell arrays are never read.
bool wanted(const matvar_t& v) {
  return v.class_type == MAT_C_STRUCT || v.class_type == MAT_C_CHAR || (v.class_type >= MAT_C_DOUBLE && v.class_type <= MAT_C_UINT64);
}

template <typename T>
void convert(const void* data, std::size_t count, std::vector<double>& out) {
  const T* from = static_cast<const T*>(data);
  for (std::size_t i = 0; i < count; ++i) out[i] = static_cast<double>(from[i]);
}

bool values_of(const matvar_t& v, std::size_t count, std::vector<double>& out) {
  out.resize(count);
  switch (v.data_type) {
    case MAT_T_DOUBLE: convert<double>(v.data, count, out); return true;
    case MAT_T_SINGLE: convert<float>(v.data, count, out); return true;
    case MAT_T_INT8: convert<std::int8_t>(v.data, count, out); return true;
    case MAT_T_UINT8: convert<std::uint8_t>(v.data, count, out); return true;
    case MAT_T_INT16: convert<std::int16_t>(v.data, count, out); return true;
    case MAT_T_UINT16: convert<std::uint16_t>(v.data, count, out); return true;
    case MAT_T_INT32: convert<std::int32_t>(v.data, count, out); return true;
    case MAT_T_UINT32: convert<std::uint32_t>(v.data, count, out); return true;
    case MAT_T_INT64: convert<std::int64_t>(v.data, count, out); return true;
    case MAT_T_UINT64: convert<std::uint64_t>(v.data, count, out); return true;
    default: return false;
  }
}

std::string text_of(const matvar_t& v) {
  std::string out;
  if (v.class_type != MAT_C_CHAR || !v.data || v.data_size <= 0) return out;
  const std::size_t count = v.nbytes / static_cast<std::size_t>(v.data_size);
  for (std::size_t i = 0; i < count; ++i) {
    unsigned code = 0;
    if (v.data_size == 1) code = static_cast<const std::uint8_t*>(v.data)[i];
    if (v.data_size == 2) code = static_cast<const std::uint16_t*>(v.data)[i];
    if (v.data_size == 4) code = static_cast<const std::uint32_t*>(v.data)[i];
    if (v.data_type != MAT_T_UINT16 && v.data_type != MAT_T_UTF16) out.push_back(static_cast<char>(code));
    else if (code < 0x80) out.push_back(static_cast<char>(code));
    else if (code < 0x800) {
      out.push_back(static_cast<char>(0xc0 | (code >> 6)));
      out.push_back(static_cast<char>(0x80 | (code & 0x3f)));
    } else {
      out.push_back('?');
    }
  }
  return out;
}

class Collector {
 public:
  void add(const std::string& name, const matvar_t& v) {
    if (v.class_type == MAT_C_CHAR && name.size() > 5 && name.ends_with("_unit")) {
      units_[name.substr(0, name.size() - 5)] = text_of(v);
      return;
    }
    if (!numeric(v) || v.rank != 2 || !v.dims) return;
    const std::size_t rows = v.dims[0], cols = v.dims[1];
    if (rows * cols < 2 || columns.size() > kMaxColumns) return;
    std::vector<double> all;
    if (!values_of(v, rows * cols, all)) return;
    if (rows == 1 || cols == 1) {
      push(name, std::move(all));
      return;
    }
    if (cols > kMaxColumns) return;
    for (std::size_t c = 0; c < cols; ++c)  // column by column, as MATLAB stores it
      push(fmt::format("{}_{}", name, c + 1), {all.begin() + static_cast<std::ptrdiff_t>(c * rows),
                                               all.begin() + static_cast<std::ptrdiff_t>((c + 1) * rows)});
  }

  void finish() {
    for (CsvColumn& c : columns) {
      const auto unit = units_.find(c.name);
      if (unit == units_.end()) continue;
      c.unit = unit->second;
      c.has_unit = true;
    }
  }

  std::vector<CsvColumn> columns;

 private:
  void push(const std::string& name, std::vector<double> values) {
    CsvColumn c;
    c.name = name;
    c.values = std::move(values);
    for (double& x : c.values)
      if (!std::isfinite(x)) {
        x = kGap;
        ++c.missing;
      }
    columns.push_back(std::move(c));
  }
  std::map<std::string, std::string> units_;
};

void add_fields(const matvar_t& structure, Collector& into) {
  auto* s = const_cast<matvar_t*>(&structure);
  char* const* names = Mat_VarGetStructFieldnames(s);
  const unsigned count = Mat_VarGetNumberOfFields(s);
  for (unsigned i = 0; names && i < count; ++i) {
    const matvar_t* field = Mat_VarGetStructFieldByIndex(s, i, 0);
    if (field && names[i]) into.add(names[i], *field);
  }
}

}  // namespace

CsvTable read_mat_columns(const std::string& path, const std::string& group) {
  const std::lock_guard<std::recursive_mutex> guard(hdf5_lock());
  std::error_code error;
  if (!std::filesystem::exists(path, error)) throw InputError(Problem{path, 0, 0, {}, "no such file", {}});
  if (std::filesystem::is_directory(path, error)) throw InputError(Problem{path, 0, 0, {}, "is a folder", "a file"});
  check_mat_file(path);
  Mat_LogInitFunc("terrode", keep_message);
  library_message().clear();
  auto refuse = [&](const std::string& what) {
    const std::string& why = library_message();
    throw InputError(Problem{path, 0, 0, {}, why.empty() ? what : what + ": " + why, {}});
  };
  const std::unique_ptr<mat_t, MatCloser> file(Mat_Open(path.c_str(), MAT_ACC_RDONLY));
  if (!file) refuse("is not a MATLAB file");

  Collector collector;
  if (group.empty()) {
    std::unique_ptr<matvar_t, VarFreer> only_structure;
    std::size_t variables = 0;
    for (std::unique_ptr<matvar_t, VarFreer> v(Mat_VarReadNextInfo(file.get())); v; v.reset(Mat_VarReadNextInfo(file.get()))) {
      ++variables;
      if (!wanted(*v) || Mat_VarReadDataAll(file.get(), v.get()) != 0) continue;
      if (v->name) collector.add(v->name, *v);
      if (variables == 1 && v->class_type == MAT_C_STRUCT) only_structure = std::move(v);
    }
    if (variables == 1 && only_structure) add_fields(*only_structure, collector);
  } else {
    std::string rest = group;
    const auto dot = rest.find('.');
    const std::unique_ptr<matvar_t, VarFreer> top(Mat_VarReadInfo(file.get(), rest.substr(0, dot).c_str()));
    const bool read = top && top->class_type == MAT_C_STRUCT && Mat_VarReadDataAll(file.get(), top.get()) == 0;
    const matvar_t* at = read ? top.get() : nullptr;
    rest = dot == std::string::npos ? "" : rest.substr(dot + 1);
    while (at && !rest.empty()) {
      const auto next = rest.find('.');
      at = at->class_type == MAT_C_STRUCT
               ? Mat_VarGetStructFieldByName(const_cast<matvar_t*>(at), rest.substr(0, next).c_str(), 0)
               : nullptr;
      rest = next == std::string::npos ? "" : rest.substr(next + 1);
    }
    if (!at || at->class_type != MAT_C_STRUCT) refuse(fmt::format("has no structure '{}'", group));
    add_fields(*at, collector);
  }
  collector.finish();
  if (collector.columns.empty()) refuse("holds no numeric vector");

  CsvTable table;
  table.file = path;
  table.columns = std::move(collector.columns);
  std::size_t rows = 0;
  for (const CsvColumn& c : table.columns) rows = std::max(rows, c.values.size());
  for (CsvColumn& c : table.columns) {
    if (c.values.size() != rows)
      table.problems.push_back({path, 0, 0, c.name, fmt::format("has {} values", c.values.size()), fmt::format("{}", rows)});
    c.values.resize(rows, kGap);
  }
  table.lines.assign(rows, 0);
  return table;
}

}  // namespace terrode::recording
