#include "recording/columns.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <limits>

#include "core/units.h"
#include "recording/gap.h"
#include "recording/hdf5_file.h"
#include "recording/mat_file.h"

namespace terrode::recording {
namespace {

constexpr std::size_t kTimeProblemsKept = 5;

std::string lower_extension(const std::string& path) {
  std::string e = std::filesystem::path(path).extension().string();
  for (char& c : e) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return e;
}

CsvTable read_hdf5_columns(const std::string& path, const std::string& group) {
  const Hdf5File file = Hdf5File::open(path);
  const std::string base = group.empty() ? "/" : (group.starts_with("/") ? group : "/" + group);
  if (!file.is_group(base)) throw InputError(Problem{path, 0, 0, {}, fmt::format("has no group '{}'", base), {}});
  CsvTable table;
  table.file = path;
  std::size_t rows = 0;
  for (const std::string& name : file.children(base)) {
    const std::string at = base == "/" ? "/" + name : base + "/" + name;
    if (!file.is_array(at) || !file.is_numeric(at)) continue;
    const auto shape = file.shape(at);
    std::size_t longest = 1, count = 1;
    for (const std::size_t n : shape) {
      longest = std::max(longest, n);
      count *= n;
    }
    if (shape.empty() || count != longest || count < 2) continue;  // only vectors, also as one row or column
    HeaderName header = split_header(name);
    CsvColumn c;
    c.name = header.name;
    c.unit = header.unit;
    c.has_unit = header.has_unit;
    for (const char* key : {"unit", "units"})
      if (const auto unit = file.text_attribute(at, key)) {
        c.unit = *unit;
        c.has_unit = true;
      }
    c.values = file.read<double>(at).values;
    rows = std::max(rows, c.values.size());
    table.columns.push_back(std::move(c));
  }
  if (table.columns.empty())
    throw InputError(Problem{path, 0, 0, {}, fmt::format("has no one-dimensional numeric array in '{}'", base), {}});
  for (CsvColumn& c : table.columns) {
    if (c.values.size() != rows)
      table.problems.push_back({path, 0, 0, c.name, fmt::format("has {} values", c.values.size()), fmt::format("{}", rows)});
    c.values.resize(rows, kGap);
    for (double& v : c.values)
      if (!std::isfinite(v)) {
        v = kGap;
        ++c.missing;
      }
  }
  table.lines.assign(rows, 0);
  return table;
}

const CsvColumn* pick(const CsvTable& table, const std::string& column) {
  if (const CsvColumn* c = table.find(column)) return c;
  if (const HeaderName h = split_header(column); h.has_unit)
    if (const CsvColumn* c = table.find(h.name)) return c;
  const auto number = parse_number(column);
  if (!number || *number != std::floor(*number) || *number < 1 || *number > static_cast<double>(table.columns.size()))
    return nullptr;
  return &table.columns[static_cast<std::size_t>(*number) - 1];
}

std::string column_names(const CsvTable& table) {
  std::string out;
  for (std::size_t i = 0; i < table.columns.size() && i < 20; ++i) out += (i ? ", " : "") + table.columns[i].name;
  if (table.columns.size() > 20) out += ", ...";
  return out;
}

// Reads a column as SI numbers under a rule; problems say what is wrong with it.
std::vector<double> read_use(const CsvTable& table, const CsvColumn& column, const ColumnUse& use, Problems& problems) {
  const auto cells = table.cell_problems(column);
  problems.insert(problems.end(), cells.begin(), cells.end());
  const auto known = channel::unit_of(use.channel);
  double factor = use.sign * use.scale;
  const bool has_unit = use.unit.has_value() || column.has_unit;
  const std::string unit = use.unit ? *use.unit : column.unit;
  const std::string wanted = use.torque_constant ? "A" : known.value_or("");
  if (known || use.torque_constant) {
    if (!has_unit && !wanted.empty()) {
      problems.push_back({table.file, table.header_line, column.header_column, column.name, "has no unit",
                          fmt::format("'{} [{}]'", column.name, wanted)});
    } else {
      const UnitFactor f = unit_factor(unit, wanted);
      if (!f.error.empty())
        problems.push_back({table.file, table.header_line, column.header_column, column.name, f.error,
                            fmt::format("a unit of {}", wanted.empty() ? "no dimension" : wanted)});
      factor *= f.factor;
    }
  }
  if (use.torque_constant) factor *= *use.torque_constant;
  std::vector<double> out = column.values;
  if (factor != 1.0 || use.offset != 0.0)
    for (double& v : out) v = v * factor + use.offset;
  return out;
}

// Linear interpolation of samples (t, x) at `at`; NaN outside and beside missing samples.
std::vector<double> interpolate(const std::vector<double>& t, const std::vector<double>& x, const std::vector<double>& at) {
  std::vector<double> out(at.size(), kGap);
  std::size_t k = 0;
  for (std::size_t i = 0; i < at.size(); ++i) {
    if (t.size() < 2 || at[i] < t.front() || at[i] > t.back()) continue;
    while (k + 2 < t.size() && t[k + 1] < at[i]) ++k;
    const double u = (at[i] - t[k]) / (t[k + 1] - t[k]);
    out[i] = u == 0.0 ? x[k] : (u == 1.0 ? x[k + 1] : (1.0 - u) * x[k] + u * x[k + 1]);
  }
  return out;
}

}  // namespace

Problems ColumnUse::validate() const {
  Problems out;
  require(out, "sign", sign, "", sign == 1.0 || sign == -1.0, "1 or -1");
  require(out, "scale", scale, "", scale != 0.0, "a number other than 0");
  require(out, "offset", offset, "", true, "a finite number");
  if (torque_constant) require(out, "torque_constant", *torque_constant, "N m/A", *torque_constant != 0.0, "a constant other than 0");
  if (torque_constant && channel != channel::driving_torque)
    out.push_back({{}, 0, 0, "torque_constant", "is given for " + channel, "only for driving_torque"});
  if (channel.empty()) out.push_back({{}, 0, 0, "channel", "is empty", "a name"});
  if (column.empty()) out.push_back({{}, 0, 0, "column", "is empty", "a column's header or number"});
  return out;
}

Problems ReadingRule::validate() const {
  Problems out;
  for (const ColumnUse& use : columns)
    for (Problem p : use.validate()) {
      p.key = "columns." + use.channel + "." + p.key;
      out.push_back(std::move(p));
    }
  if (sample_rate) require(out, "sample_rate", *sample_rate, "Hz", *sample_rate > 0.0, "a rate above 0");
  if (csv.decimal_comma && csv.separator == ',')
    out.push_back({{}, 0, 0, "separator", "is a comma, as the decimal mark is", "another separator"});
  return out;
}

UnitFactor unit_factor(const std::string& unit, const std::string& si_unit) {
  UnitFactor out;
  const auto given = parse_unit(unit);
  const auto wanted = parse_unit(si_unit);
  if (!given) {
    out.error = fmt::format("has the unit '{}', which is not known", unit.substr(0, 40));
  } else if (!wanted || !same_dimension(*given, *wanted) || (given->angle && !wanted->angle)) {
    out.error = fmt::format("has the unit '{}', which cannot be converted", unit.substr(0, 40));
  } else {
    out.factor = given->to_si;
  }
  return out;
}

CsvTable read_columns(const std::string& path, const ReadingRule& rule) {
  const std::string extension = lower_extension(path);
  if (extension == ".h5" || extension == ".hdf5") return read_hdf5_columns(path, rule.group);
  if (extension == ".mat") return read_mat_columns(path, rule.group);
  return read_csv(path, rule.csv);
}

void fill_run(const CsvTable& table, const ReadingRule& rule, Run& run, Problems& problems, std::vector<Remark>& remarks) {
  problems.insert(problems.end(), table.problems.begin(), table.problems.end());
  std::vector<ColumnUse> uses = rule.columns;
  if (uses.empty())
    for (const CsvColumn& c : table.columns)
      if (channel::unit_of(c.name)) {
        ColumnUse use;
        use.channel = use.column = c.name;
        uses.push_back(std::move(use));
      }

  std::vector<const CsvColumn*> used;
  std::vector<double> time;
  bool have_time = false;
  if (rule.sample_rate) {
    time.resize(table.rows());
    for (std::size_t i = 0; i < time.size(); ++i) time[i] = static_cast<double>(i) / *rule.sample_rate;
    have_time = true;
  }
  for (const ColumnUse& use : uses) {
    if (use.channel != "time" || rule.sample_rate) continue;
    const CsvColumn* c = pick(table, use.column);
    if (!c) break;
    used.push_back(c);
    time = read_use(table, *c, use, problems);
    have_time = true;
    break;
  }
  if (!have_time) {
    problems.push_back({table.file, table.header_line, 0, "time", "is missing",
                        fmt::format("a column 'time [s]' (columns are: {})", column_names(table))});
  }

  // Which samples stay: times must be there and increase. More than a few complaints about one file do not help.
  std::vector<std::size_t> keep;
  keep.reserve(time.size());
  std::size_t complaints = 0, repeated = 0;
  double last = -std::numeric_limits<double>::infinity();
  int first_repeated = 0;
  for (std::size_t i = 0; i < time.size(); ++i) {
    if (std::isfinite(time[i]) && time[i] > last) {
      keep.push_back(i);
      last = time[i];
      continue;
    }
    if (std::isfinite(time[i]) && time[i] == last) {
      if (repeated++ == 0) first_repeated = table.lines[i];
      continue;
    }
    if (++complaints > kTimeProblemsKept) continue;
    const std::string what = std::isfinite(time[i]) ? fmt::format("goes back from {} s to {} s", last, time[i]) : "is missing";
    problems.push_back({table.file, table.lines[i], 0, "time", what, "times that increase"});
  }
  if (complaints > kTimeProblemsKept)
    problems.push_back({table.file, 0, 0, "time", fmt::format("{} more samples are out of order", complaints - kTimeProblemsKept), {}});
  if (repeated > 0)
    remarks.push_back({table.file, fmt::format("{} samples repeat the time before them{} and are left out", repeated,
                                               first_repeated > 0 ? fmt::format(" (first in line {})", first_repeated) : "")});

  const bool all_kept = keep.size() == time.size();
  auto kept = [&](std::vector<double> values) {
    if (all_kept) return values;
    std::vector<double> out;
    out.reserve(keep.size());
    for (const std::size_t i : keep) out.push_back(values[i]);
    return out;
  };
  run.time = kept(time);
  run.lines.clear();
  if (!table.lines.empty() && table.lines.front() > 0) {
    run.lines.reserve(keep.size());
    for (const std::size_t i : keep) run.lines.push_back(table.lines[i]);
  }

  for (const ColumnUse& use : uses) {
    if (use.channel == "time") continue;
    const CsvColumn* c = pick(table, use.column);
    if (!c) {
      problems.push_back({table.file, table.header_line, 0, use.channel, fmt::format("has no column '{}'", use.column),
                          "one of " + column_names(table)});
      continue;
    }
    used.push_back(c);
    if (c->missing + c->bad_count == c->values.size()) {
      if (c->bad_count > 0) {
        const auto cells = table.cell_problems(*c);
        problems.insert(problems.end(), cells.begin(), cells.end());
      } else {
        remarks.push_back({table.file, fmt::format("column '{}' is empty and left out", c->name)});
      }
      continue;
    }
    Channel ch;
    ch.name = use.channel;
    ch.unit = channel::unit_of(use.channel).value_or(use.unit.value_or(c->unit));
    ch.values = read_use(table, *c, use, problems);
    if (use.clock.empty()) {
      ch.values = kept(std::move(ch.values));
    } else if (const CsvColumn* clock = pick(table, use.clock)) {
      used.push_back(clock);
      ColumnUse as_time;
      as_time.channel = "time";
      if (const HeaderName h = split_header(use.clock); h.has_unit) as_time.unit = h.unit;
      const std::vector<double> own = read_use(table, *clock, as_time, problems);
      std::vector<double> t, x;
      for (std::size_t i = 0; i < own.size(); ++i) {
        if (!std::isfinite(own[i])) continue;  // the shorter of two clocks ends with empty cells
        if (!t.empty() && own[i] <= t.back()) {
          problems.push_back({table.file, table.lines[i], 0, clock->name, "does not increase", "times that increase"});
          break;
        }
        t.push_back(own[i]);
        x.push_back(ch.values[i]);
      }
      ch.values = interpolate(t, x, run.time);
    } else {
      problems.push_back({table.file, table.header_line, 0, use.channel, fmt::format("has no clock column '{}'", use.clock),
                          "one of " + column_names(table)});
    }
    run.channels.push_back(std::move(ch));
  }

  for (const CsvColumn& c : table.columns) {
    if (std::find(used.begin(), used.end(), &c) != used.end() || c.name.empty()) continue;
    if (run.find(c.name)) continue;
    if (channel::unit_of(c.name)) continue;  // a known name that the map gives to another column
    std::string hint;
    for (const std::string& name : channel::names())
      if (edit_distance(c.name, name) <= 2) hint = fmt::format(" (did you mean '{}'?)", name);
    if (c.bad_count > 0) {
      remarks.push_back({table.file, fmt::format("column '{}' holds text: left out{}", c.name, hint)});
      continue;
    }
    remarks.push_back({table.file, fmt::format("column '{}' is not known: kept and ignored{}", c.name, hint)});
    run.channels.push_back({c.name, c.unit, kept(c.values)});
  }
}

std::optional<std::vector<double>> column_in_si(const CsvTable& table, const std::string& name,
                                                const std::string& si_unit, Problems& problems) {
  const CsvColumn* c = table.find(name);
  if (!c) {
    std::string expected = fmt::format("a column '{} [{}]' (columns are: {})", name, si_unit, column_names(table));
    problems.push_back({table.file, table.header_line, 0, name, "is missing", expected});
    return std::nullopt;
  }
  const auto cells = table.cell_problems(*c);
  problems.insert(problems.end(), cells.begin(), cells.end());
  if (!c->has_unit && !si_unit.empty()) {
    problems.push_back({table.file, table.header_line, c->header_column, name, "has no unit", fmt::format("'{} [{}]'", name, si_unit)});
    return std::nullopt;
  }
  const UnitFactor f = unit_factor(c->unit, si_unit);
  if (!f.error.empty()) {
    problems.push_back({table.file, table.header_line, c->header_column, name, f.error, "a unit of " + si_unit});
    return std::nullopt;
  }
  std::vector<double> out = c->values;
  for (double& v : out) v *= f.factor;
  return out;
}

}  // namespace terrode::recording
