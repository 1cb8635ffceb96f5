// Result files: what `sweep` and `run` write, as plain HDF5 groups that h5py, MATLAB and HDFView read. docs/formats.md
// describes the layout.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "recording/hdf5_file.h"
#include "recording/recording.h"

namespace terrode::recording {

// Newest version this program writes: readers refuse a higher first number.
inline constexpr int kResultSchemaVersion[2] = {1, 0};

// What a result file says about itself, in attributes of its root.
struct ResultHeader {
  std::string filetype;           // "terrode sweep", "terrode run"
  std::string generator;          // program, version and commit
  std::string created;            // UTC, ISO 8601
  std::string title;
  std::string scenario_file;
  std::string scenario_text;      // as the file stood
  std::string scenario_resolved;  // complete in itself: what decides whether two results belong together
  std::string slip_convention;
  std::string command;
  std::int64_t seed = 1;

  // Generator and time of now filled in.
  static ResultHeader now(std::string filetype);
};

// A column of numbers with its unit (SI, "" for none).
struct ResultColumn {
  std::string name, unit, description;
  std::vector<double> values;
};

// Columns of equal length, and columns of text.
struct ResultTable {
  std::vector<ResultColumn> columns;
  std::map<std::string, std::vector<std::string>> texts;
  std::size_t rows() const;
  const ResultColumn* find(const std::string& name) const;
};

void write_header(Hdf5File& file, const ResultHeader& header);
// Throws InputError where this is no result file, or one of a newer kind.
ResultHeader read_header(const Hdf5File& file);

void write_table(Hdf5File& file, const std::string& group, const ResultTable& table);
ResultTable read_table(const Hdf5File& file, const std::string& group);

// A time series: dataset `time` and one for each channel.
void write_series(Hdf5File& file, const std::string& group, const Run& run);
Run read_series(const Hdf5File& file, const std::string& group);

// A time series as CSV: units in the header, '.' as decimal point, digits that read back to the same values.
std::string series_csv(const Run& run);

// Unit and meaning of the columns that results have in common; empty where the name has none.
std::string column_unit(const std::string& name);
std::string column_description(const std::string& name);

// Methods in a sweep file ("steady", ...), or {"run"} for a single run.
std::vector<std::string> result_methods(const Hdf5File& file);
// The runs of one method as a recording, so that a result is compared as a measurement is: time series where there are,
// else steady values; points that failed are left out. Throws InputError where the method is not in the file.
Recording read_result(const std::string& path, const std::string& method = {});

}  // namespace terrode::recording
