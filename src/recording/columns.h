// From the columns of a file to the channels of a run: what each column means, its unit, sign, clock.
//
// Without a column map the header names the channels. A map says for each channel which column it is, where the header
// does not: by header text or, without header, by number; with unit, sign, and a constant that turns a motor's current
// into torque.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/problem.h"
#include "recording/csv.h"
#include "recording/recording.h"

namespace terrode::recording {

// One channel and the column it comes from: value = sign * scale * (column in SI) * torque_constant + offset.
struct ColumnUse {
  std::string channel;                     // "time", "drawbar_pull", ... or any name
  std::string column;                      // header text before the bracket, or number from 1
  std::optional<std::string> unit;         // unit of the column where the header has none (or a wrong one)
  double sign = 1.0;                       // 1 or -1
  double scale = 1.0;                      // dimensionless
  double offset = 0.0;                     // in the channel's SI unit, added last
  std::string clock;                       // column that holds the times [s] of this channel; "": the run's own
  std::optional<double> torque_constant;   // N m/A: the column is a current

  Problems validate() const;
};

// How the files of a recording are to be read.
struct ReadingRule {
  CsvFormat csv;
  std::vector<ColumnUse> columns;      // empty: the header names the channels
  std::optional<double> sample_rate;   // Hz: times are made from it, no time column is needed
  std::string group;                   // HDF5 group or MATLAB structure that holds the columns, "" for the top

  Problems validate() const;
};

// A note for the user about a file; the same text about many files is said once.
struct Remark {
  std::string file;
  std::string text;
};

// The factor that takes numbers in `unit` to `si_unit`, or a text that says why there is none ("has unit kg").
struct UnitFactor {
  double factor = 1.0;
  std::string error;
};
UnitFactor unit_factor(const std::string& unit, const std::string& si_unit);

// Reads the columns of a file: .h5/.hdf5 (one-dimensional arrays of a group, attribute `unit` for their units), .mat
// (numeric vectors, see mat_file.h), anything else as CSV. Throws InputError where the file cannot be read.
CsvTable read_columns(const std::string& path, const ReadingRule& rule);

// Fills times, lines and channels of a run from columns. Everything wrong goes to `problems` with its line: no time
// column, times that are missing or go back, units that are missing or cannot be converted, cells that are no numbers.
// Missing cells of a channel stay NaN. Samples that repeat the time before them are left out with a remark. Channels on
// a clock of their own are interpolated linearly to the run's times (NaN outside their own). Columns without a meaning
// are kept as they are, with a remark.
void fill_run(const CsvTable& table, const ReadingRule& rule, Run& run, Problems& problems, std::vector<Remark>& remarks);

// A column as numbers in SI; used for soil tests. Nothing (and problems) where it is missing or wrong.
std::optional<std::vector<double>> column_in_si(const CsvTable& table, const std::string& name,
                                                const std::string& si_unit, Problems& problems);

}  // namespace terrode::recording
