// Recordings in the format `recording/1`: a folder with recording.yaml and a table for each run and soil test.
#pragma once

#include <string>

#include "core/problem.h"
#include "recording/columns.h"
#include "recording/recording.h"
#include "scenario/reader.h"

namespace terrode::scenario {

// What was read, and everything that is wrong with it, each with its file, line and column. Where there are problems
// the recording holds what could be read. Notes about keys and columns kept, and defaults assumed, are its remarks.
struct RecordingCheck {
  recording::Recording recording;
  Problems problems;
};

// Reads a recording; `path` is its folder or its recording.yaml, `threads` reads that many runs at a time (0: all
// cores). Throws InputError only where recording.yaml is missing or no YAML at all.
RecordingCheck check_recording(const std::string& path, int threads = 1);

// The same for everybody else: throws InputError with every problem.
recording::Recording load_recording(const std::string& path, int threads = 1);

// True for a folder that holds a recording.yaml, and for a YAML file whose `format` is a recording's.
bool is_recording(const std::string& path);

// Reads the keys `csv`, `columns`, `sample_rate` and `group` of a map: how the tables are to be read. They are allowed
// at the top of a recording and in single runs and soil tests.
recording::ReadingRule read_reading_rule(MapReader& reader, const recording::ReadingRule& base);

// One table by itself (CSV, HDF5, .mat) as a run, read by the rules in the YAML file `map` ("" for none).
// Throws InputError with every problem.
recording::Run load_table(const std::string& path, const std::string& map, std::vector<std::string>& remarks);

// The angular velocity that a recording without any velocity is taken to have [rad/s].
inline constexpr double kAssumedAngularVelocity = 0.3;

}  // namespace terrode::scenario
