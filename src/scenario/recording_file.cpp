#include "scenario/recording_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <numbers>
#include <set>

#include "bekker/slip.h"
#include "core/parallel.h"
#include "core/units.h"

namespace terrode::scenario {

namespace fs = std::filesystem;
using recording::CsvColumn;
using recording::CsvTable;
using recording::ReadingRule;
using recording::Recording;
using recording::Remark;
using recording::Run;
using recording::TextTable;

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::size_t kMaxRuns = 20000;
constexpr int kMaxPass = 10000;
// Slip, angular and forward velocity given together may differ by rounding; beyond this the file is asked about.
constexpr double kSlipDisagreement = 0.02;

// Text of any value, for keys that are kept without being understood.
std::string as_text(const Node& node) {
  if (node.kind == Node::Kind::scalar) return node.text;
  std::string text = to_yaml(node);
  while (!text.empty() && text.back() == '\n') text.pop_back();
  return text;
}

// The keys of a run, whether from runs[] or from a row of a runs table.
struct RunKeys {
  std::optional<double> slip;  // as given, by the file's convention
  std::string where_file;      // for problems
  int line = 0, column = 0;
  std::string key;
};

class Reader {
 public:
  Reader(const std::string& path, int threads) : threads_(threads) {
    std::error_code error;
    file_ = fs::is_directory(path, error) ? (fs::path(path) / "recording.yaml").string() : path;
    out_.recording.folder = fs::path(file_).parent_path().string();
    if (out_.recording.folder.empty()) out_.recording.folder = ".";
    source_.file = file_;
  }

  RecordingCheck read() {
    const Node root = read_yaml(file_);
    MapReader top(root, "", source_, MapReader::Unknown::keep);
    Recording& r = out_.recording;
    if (top.need("format")) {
      const auto format = top.text("format");
      if (format && *format != "recording/1")
        source_.problem(*root.find("format"), "format", fmt::format("is '{}'", *format), "recording/1");
    }
    r.title = top.text("title").value_or("");
    r.source = top.text("source").value_or("");
    r.licence = top.text("licence").value_or("");
    r.notes = top.text("notes").value_or("");
    read_convention(top);
    read_wheel(top);
    read_soil(top);
    rule_ = read_reading_rule(top, {});
    tare_file_ = look_at(top.text("tare").value_or(""), top.node(), "tare", source_);

    const bool has_runs = top.has("runs"), has_table = top.has("runs_table");
    if (has_runs && has_table) source_.problem(*root.find("runs_table"), "runs_table", "is given beside runs", "one of the two");
    if (!has_runs && !has_table && root.kind == Node::Kind::map)
      source_.problem(root, "runs", "is missing", "runs, or runs_table");
    if (has_runs) read_runs(top);
    if (has_table && !has_runs) read_runs_table(top);
    read_soil_tests(top);
    keep_rest(top, "");
    read_run_files();
    check_ids();

    out_.problems.insert(out_.problems.begin(), source_.problems.begin(), source_.problems.end());
    std::vector<std::string>& remarks = r.remarks;
    remarks.insert(remarks.begin(), source_.notes.begin(), source_.notes.end());
    add_file_remarks();
    return std::move(out_);
  }

 private:
  std::string inside(const std::string& name) const {
    return (fs::path(out_.recording.folder) / name).lexically_normal().string();
  }

  // What leads out of the recording's folder is said; a device or pipe is refused.
  std::string look_at(const std::string& name, const Node& where, const std::string& key, Source& source) const {
    if (name.empty()) return name;
    const std::size_t before = source.problems.size();
    named_path(name, where, key, source);
    return source.problems.size() > before ? std::string() : name;
  }

  // Keys that nobody asked for: an error when one letter away from a known one, else kept with a note.
  void keep_rest(MapReader& map, const std::string& path) {
    for (const auto& [key, value] : map.finish()) out_.recording.extra[path.empty() ? key : path + "." + key] = as_text(*value);
  }

  void read_convention(MapReader& top) {
    const auto text = top.text("slip_convention");
    out_.recording.slip_convention = text.value_or(bekker::slip_convention_text(convention_));
    if (!text) return;
    if (const auto c = bekker::parse_slip_convention(*text)) {
      convention_ = *c;
      return;
    }
    std::string expected;
    for (const auto c : {bekker::SlipConvention::wong_reece, bekker::SlipConvention::driving_braking, bekker::SlipConvention::printed})
      expected += fmt::format("{}'{}'", expected.empty() ? "" : " or ", bekker::slip_convention_text(c));
    source_.problem(*top.node().find("slip_convention"), "slip_convention", fmt::format("is '{}'", *text), expected);
  }

  void read_wheel(MapReader& top) {
    if (!top.need("wheel")) return;
    auto w = top.section("wheel");
    if (!w) return;
    recording::WheelInfo& wheel = out_.recording.wheel;
    if (w->need("radius")) wheel.radius = w->number("radius", "m", above(0)).value_or(0.0);
    if (w->need("width")) wheel.width = w->number("width", "m", above(0)).value_or(0.0);
    wheel.mass = w->number("mass", "kg", at_least(0));
    wheel.surface = w->text("surface").value_or("");
    if (auto g = w->section("grousers")) {
      if (g->need("count"))
        if (const auto n = g->integer("count", 0, 10000)) wheel.grouser_count = static_cast<int>(*n);
      if (g->need("height")) wheel.grouser_height = g->number("height", "m", at_least(0));
      keep_rest(*g, "wheel.grousers");
    }
    keep_rest(*w, "wheel");
  }

  void read_soil(MapReader& top) {
    recording::SoilBelief& soil = out_.recording.soil;
    soil.a0 = 0.18;
    soil.a1 = 0.32;
    soil.theta_r = 0.0;
    auto s = top.section("soil");
    if (!s) return;
    soil.name = s->text("name").value_or("");
    soil.bulk_density = s->number("bulk_density", "kg/m^3", above(0));
    if (auto b = s->section("bekker")) {
      soil.cohesion = b->number("cohesion", "Pa", at_least(0));
      Range angle = at_least(0);
      angle.hi = std::numbers::pi / 2;
      angle.hi_open = true;
      soil.friction_angle = b->number("friction_angle", "rad", angle);
      soil.shear_modulus = b->number("shear_modulus", "m", above(0));
      soil.n = b->number("n", "-", above(0));
      soil.k = b->number("k", "Pa", above(0));
      soil.plate_width = b->number("plate_width", "m", above(0));
      // The units of kc and kphi follow from n; without n only bare SI numbers mean anything.
      const auto bekker_number = [&](const char* key, double extra) -> std::optional<double> {
        const Node* node = b->find(key);
        if (!node) return std::nullopt;
        if (soil.n) return read_number(*node, b->key(key), fmt::format("N/m^{}", *soil.n + extra), any_number(), source_);
        const auto value = node->kind == Node::Kind::scalar ? parse_number(node->text) : std::nullopt;
        if (!value)
          source_.problem(*node, b->key(key), fmt::format("is '{}' and n is not given", as_text(*node)), "n, or a bare number in SI");
        return value;
      };
      soil.kc = bekker_number("kc", 1.0);
      soil.kphi = bekker_number("kphi", 2.0);
      if (soil.k && (soil.kc || soil.kphi))
        source_.problem(*b->node().find("k"), b->key("k"), "is given beside kc or kphi", "one of the two forms");
      if (soil.k && !soil.plate_width)
        out_.recording.remarks.push_back(fmt::format("{}: soil.bekker.k is given without plate_width: its meaning is open until one is stated", file_));
      keep_rest(*b, "soil.bekker");
    }
    if (auto c = s->section("contact")) {
      if (const auto v = c->number("a0", "-")) soil.a0 = v;
      if (const auto v = c->number("a1", "-")) soil.a1 = v;
      Range behind;
      behind.hi = 0.0;
      behind.lo = -std::numbers::pi / 2;
      if (const auto v = c->number("theta_r", "rad", behind)) soil.theta_r = v;
      keep_rest(*c, "soil.contact");
    }
    keep_rest(*s, "soil");
  }

  // Turns what a run says into its condition; problems and assumptions are said under `keys`.
  void settle_condition(Run& run, const RunKeys& keys) {
    recording::Condition& c = run.condition;
    const double r = out_.recording.wheel.radius;
    const auto complain = [&](const std::string& message, const std::string& expected) {
      out_.problems.push_back({keys.where_file, keys.line, keys.column, keys.key + "slip", message, expected});
    };
    if (keys.slip) {
      try {
        c.slip = bekker::to_wong_reece(*keys.slip, convention_);
      } catch (const InputError& e) {
        complain(e.problems().front().message, e.problems().front().expected);
        return;
      }
    } else if (c.angular_velocity && c.forward_velocity && r > 0) {
      try {
        c.slip = bekker::slip_of_motion(*c.forward_velocity, *c.angular_velocity, r);
      } catch (const InputError& e) {
        complain("is missing, and " + e.problems().front().message, e.problems().front().expected);
        return;
      }
    } else {
      pending_slip_.push_back(&run - out_.recording.runs.data());
      return;
    }
    settle_velocities(run, keys);
  }

  void settle_velocities(Run& run, const RunKeys& keys) {
    recording::Condition& c = run.condition;
    const double r = out_.recording.wheel.radius;
    if (!c.angular_velocity && !c.forward_velocity) {
      if (std::isinf(c.slip)) {
        c.angular_velocity = 0.0;
        c.forward_velocity = kAssumedAngularVelocity * r;
      } else {
        c.angular_velocity = kAssumedAngularVelocity;
      }
      ++assumed_velocity_;
    }
    if (r <= 0) return;
    if (c.angular_velocity && c.forward_velocity && keys.slip) {
      const double omega = *c.angular_velocity, v = *c.forward_velocity;
      const double motion = omega > 0 ? 1.0 - v / (omega * r) : -kInfinity;
      // Compared by the carriage's speed over the faster of the two, which is bounded at either sign.
      const double fastest = std::max(std::abs(omega) * r, std::abs(v));
      const double stated = std::isinf(c.slip) ? 0.0 : omega * r;
      const double implied_v = std::isinf(c.slip) ? v : stated * (1.0 - c.slip);
      const double off = std::isinf(c.slip) ? std::abs(omega) * r : std::abs(implied_v - v);
      if (fastest > 0 && off > kSlipDisagreement * fastest)
        disagreements_.push_back(fmt::format("{}: run '{}': slip {:.3g} is stated, the velocities say {:.3g}: the stated one is used",
                                             keys.where_file, run.id, c.slip, motion));
      return;
    }
    if (c.angular_velocity && !c.forward_velocity) {
      if (std::isinf(c.slip)) {
        // A locked wheel with its rate only: how fast the carriage goes is not known.
        return;
      }
      c.forward_velocity = *c.angular_velocity * r * (1.0 - c.slip);
    } else if (c.forward_velocity && !c.angular_velocity) {
      if (std::isinf(c.slip)) {
        c.angular_velocity = 0.0;
      } else if (c.slip < 1.0) {
        c.angular_velocity = *c.forward_velocity / (r * (1.0 - c.slip));
      }
    }
  }

  void read_runs(MapReader& top) {
    const auto items = top.items("runs");
    if (items.size() > kMaxRuns) {
      source_.problem(*top.node().find("runs"), "runs", fmt::format("has {} items", items.size()), fmt::format("at most {}", kMaxRuns));
      return;
    }
    if (const Node* n = top.node().find("runs"); n && n->kind == Node::Kind::sequence && items.empty())
      source_.problem(*n, "runs", "is empty", "at least one run");
    std::vector<Run>& runs = out_.recording.runs;
    runs.reserve(items.size());
    for (const auto& [key, node] : items) {
      // Notes about further keys of runs are gathered: the same one would come once for each run.
      Source own{file_, {}, {}};
      MapReader m(*node, key, own, MapReader::Unknown::keep);
      Run& run = runs.emplace_back();
      Pending pending;
      pending.node = node;
      pending.key = key;
      run.id = m.text("id").value_or("");
      run.file = look_at(m.text("file").value_or(""), *node, m.key("file"), source_);
      if (node->kind == Node::Kind::map && !node->find("file")) own.problem(*node, m.key("file"), "is missing", "the name of the run's table");
      if (run.id.empty()) run.id = run.file.empty() ? fmt::format("run{}", runs.size()) : fs::path(run.file).stem().string();
      RunKeys keys{m.number("slip", "-"), file_, node->line, node->column, key + "."};
      run.condition.normal_load = m.number("normal_load", "N", above(0));
      run.condition.angular_velocity = m.number("angular_velocity", "rad/s", at_least(0));
      run.condition.forward_velocity = m.number("forward_velocity", "m/s", at_least(0));
      run.condition.pass = static_cast<int>(m.integer("pass", 1, kMaxPass).value_or(1));
      run.condition.repeat = static_cast<int>(m.integer("repeat", 1, kMaxPass).value_or(1));
      pending.rule = read_reading_rule(m, rule_);
      pending.tare = m.has("tare") ? look_at(m.text("tare").value_or(""), *node, m.key("tare"), source_) : tare_file_;
      for (const auto& [name, value] : m.finish()) {
        run.condition.extra[name] = as_text(*value);
        ++further_keys_[name];
      }
      source_.problems.insert(source_.problems.end(), own.problems.begin(), own.problems.end());
      const bool bad_slip = node->find("slip") && !keys.slip;
      if (!bad_slip) settle_condition(run, keys);
      pending.keys = keys;
      pending_.push_back(std::move(pending));
    }
  }

  void read_runs_table(MapReader& top) {
    if (!top.has("runs_table")) return;
    const Node& where = *top.node().find("runs_table");
    const std::string name = look_at(top.text("runs_table").value_or(""), where, "runs_table", source_);
    if (name.empty()) return;
    TextTable table;
    try {
      table = recording::read_text_table(inside(name), rule_.csv);
    } catch (const InputError& e) {
      add_located(e, where, "runs_table");
      return;
    }
    Problems& problems = out_.problems;
    problems.insert(problems.end(), table.problems.begin(), table.problems.end());
    if (table.rows.size() > kMaxRuns) {
      problems.push_back({table.file, 0, 0, {}, fmt::format("has {} rows", table.rows.size()), fmt::format("at most {}", kMaxRuns)});
      return;
    }
    struct Use {
      enum class Kind { id, file, slip, load, omega, speed, pass, repeat, mean, std, kept } kind = Kind::kept;
      std::string name;
      double factor = 1.0;
    };
    const std::vector<std::string> conditions = {"id", "file", "slip", "normal_load", "angular_velocity", "forward_velocity", "pass", "repeat"};
    std::vector<std::string> known = conditions;
    for (const std::string& c : recording::channel::names()) {
      known.push_back(c);
      known.push_back(c + "_std");
    }
    std::vector<Use> uses;
    for (const CsvColumn& c : table.columns) {
      Use use;
      use.name = c.name;
      std::string unit;
      if (c.name == "id") use.kind = Use::Kind::id;
      else if (c.name == "file") use.kind = Use::Kind::file;
      else if (c.name == "slip") use.kind = Use::Kind::slip;
      else if (c.name == "pass") use.kind = Use::Kind::pass;
      else if (c.name == "repeat") use.kind = Use::Kind::repeat;
      else if (c.name == "normal_load") use.kind = Use::Kind::load, unit = "N";
      else if (c.name == "angular_velocity") use.kind = Use::Kind::omega, unit = "rad/s";
      else if (c.name == "forward_velocity") use.kind = Use::Kind::speed, unit = "m/s";
      else if (const auto u = recording::channel::unit_of(c.name); u && c.name != "time") use.kind = Use::Kind::mean, unit = *u;
      else if (c.name.ends_with("_std")) {
        use.name = c.name.substr(0, c.name.size() - 4);
        if (const auto of = recording::channel::unit_of(use.name); of && use.name != "time") {
          use.kind = Use::Kind::std;
          unit = *of;
        } else {
          use.name = c.name;
        }
      }
      if (use.kind == Use::Kind::kept) {
        if (c.name == "time") {
          problems.push_back({table.file, 1, c.header_column, "time", "stands in a table of steady values",
                              "one row for each run, no time"});
          uses.push_back(use);
          continue;
        }
        const std::string near = nearest_word(c.name, known);
        if (!near.empty() && edit_distance(c.name, near) <= 1)
          problems.push_back({table.file, 1, c.header_column, c.name, fmt::format("is not a known column (did you mean '{}'?)", near), {}});
        else if (!c.name.empty())
          file_remarks_.push_back({table.file, fmt::format("column '{}' is not known: kept and ignored", c.name)});
      } else if (!unit.empty() || c.has_unit) {
        if (!c.has_unit) {
          problems.push_back({table.file, 1, c.header_column, c.name, "has no unit", fmt::format("'{} [{}]'", c.name, unit)});
        } else if (use.kind != Use::Kind::id && use.kind != Use::Kind::file) {
          const recording::UnitFactor f = recording::unit_factor(c.unit, unit);
          if (!f.error.empty())
            problems.push_back({table.file, 1, c.header_column, c.name, f.error, fmt::format("a unit of {}", unit.empty() ? "no dimension" : unit)});
          use.factor = f.factor;
        }
      }
      uses.push_back(use);
    }
    std::vector<Run>& runs = out_.recording.runs;
    runs.reserve(table.rows.size());
    for (const auto& row : table.rows) {
      Run& run = runs.emplace_back();
      RunKeys keys{std::nullopt, table.file, row.front().line, 0, ""};
      std::map<std::string, double> deviations;
      bool bad_slip = false;
      for (std::size_t i = 0; i < uses.size(); ++i) {
        const TextTable::Cell& cell = row[i];
        const Use& use = uses[i];
        if (cell.text.empty()) continue;
        if (use.kind == Use::Kind::id) {
          run.id = cell.text;
          continue;
        }
        if (use.kind == Use::Kind::file) {
          Node place;
          place.line = cell.line;
          place.column = cell.column;
          run.file = look_at(cell.text, place, "file", source_);
          continue;
        }
        if (use.kind == Use::Kind::kept) {
          run.condition.extra[use.name] = cell.text;
          continue;
        }
        std::string digits = cell.text;
        if (rule_.csv.decimal_comma && digits.find('.') == std::string::npos) std::replace(digits.begin(), digits.end(), ',', '.');
        const auto number = parse_number(digits);
        if (!number) {
          std::string lower = cell.text;
          for (char& ch : lower) ch = static_cast<char>(std::tolower(static_cast<unsigned char>(ch)));
          if (lower == "nan" || lower == "na" || lower == "n/a") continue;  // not measured
          problems.push_back({table.file, cell.line, cell.column, table.columns[i].name, fmt::format("is '{}'", cell.text.substr(0, 40)), "a number, or an empty cell"});
          bad_slip = bad_slip || use.kind == Use::Kind::slip;
          continue;
        }
        const double value = *number * use.factor;
        const auto whole = [&](int& into) {
          if (value == std::floor(value) && value >= 1 && value <= kMaxPass) into = static_cast<int>(value);
          else problems.push_back({table.file, cell.line, cell.column, use.name, fmt::format("is {}", cell.text), fmt::format("a whole number from 1 to {}", kMaxPass)});
        };
        const auto need_range = [&](bool ok, const char* expected) {
          if (!ok) problems.push_back({table.file, cell.line, cell.column, use.name, fmt::format("is {}", cell.text), expected});
        };
        switch (use.kind) {
          case Use::Kind::slip: keys.slip = value; keys.column = cell.column; break;
          case Use::Kind::load: need_range(value > 0, "a load above 0"); run.condition.normal_load = value; break;
          case Use::Kind::omega: need_range(value >= 0, "a rate of at least 0"); run.condition.angular_velocity = value; break;
          case Use::Kind::speed: need_range(value >= 0, "a speed of at least 0"); run.condition.forward_velocity = value; break;
          case Use::Kind::pass: whole(run.condition.pass); break;
          case Use::Kind::repeat: whole(run.condition.repeat); break;
          case Use::Kind::mean: run.steady[use.name].mean = value; break;
          case Use::Kind::std: need_range(value >= 0, "a deviation of at least 0"); deviations[use.name] = value; break;
          default: break;
        }
      }
      for (const auto& [channel_name, deviation] : deviations) {
        auto found = run.steady.find(channel_name);
        if (found == run.steady.end()) {
          // The load and the velocities are conditions; with a scatter of their own they were measured too.
          std::optional<double> mean;
          if (channel_name == recording::channel::normal_load) mean = run.condition.normal_load;
          if (channel_name == recording::channel::angular_velocity) mean = run.condition.angular_velocity;
          if (channel_name == recording::channel::forward_velocity) mean = run.condition.forward_velocity;
          if (!mean) {
            problems.push_back({table.file, keys.line, 0, channel_name + "_std", "is given without its mean", {}});
            continue;
          }
          found = run.steady.emplace(channel_name, recording::SteadyValue{*mean, {}}).first;
        }
        found->second.std = deviation;
      }
      if (run.id.empty()) run.id = run.file.empty() ? fmt::format("row{}", runs.size()) : fs::path(run.file).stem().string();
      if (!bad_slip) settle_condition(run, keys);
      Pending pending;
      pending.node = &where;
      pending.key = "runs_table";
      pending.rule = rule_;
      pending.tare = tare_file_;
      pending.keys = keys;
      pending_.push_back(std::move(pending));
    }
  }

  // A file that cannot be read: said with the file, and with the place in recording.yaml that names it.
  void add_located(const InputError& e, const Node& where, const std::string& key) {
    for (const Problem& p : e.problems()) {
      if (p.line > 0) {
        out_.problems.push_back(p);
        continue;
      }
      out_.problems.push_back({file_, where.line, where.column, key, fmt::format("names {}, which {}", p.file, p.message == "no such file" ? "is not there" : p.message), p.expected});
    }
  }

  void read_soil_tests(MapReader& top) {
    for (const auto& [key, node] : top.items("soil_tests")) {
      MapReader m(*node, key, source_, MapReader::Unknown::keep);
      if (node->kind != Node::Kind::map) continue;
      m.need("kind");
      const auto kind = m.choice("kind", {"pressure_sinkage", "direct_shear"});
      m.need("file");
      const std::string name = look_at(m.text("file").value_or(""), *node, m.key("file"), source_);
      const auto rate = m.number("rate", "m/s", at_least(0));
      const bool pressure = kind == "pressure_sinkage";
      recording::PressureSinkageTest plate;
      recording::DirectShearTest shear;
      if (pressure) {
        const auto shape = m.choice("plate_shape", {"circle", "rectangle"});
        plate.circular = shape == "circle";
        if (!shape && m.has("plate_diameter") && !m.has("plate_width")) plate.circular = true;
        if (plate.circular) {
          if (m.need("plate_diameter")) plate.plate_width = m.number("plate_diameter", "m", above(0)).value_or(0.0);
          for (const char* k : {"plate_width", "plate_length"})
            if (m.has(k)) source_.problem(*node->find(k), m.key(k), "is given for a circular plate", "plate_diameter alone");
        } else {
          if (m.need("plate_width")) plate.plate_width = m.number("plate_width", "m", above(0)).value_or(0.0);
          if (m.need("plate_length")) plate.plate_length = m.number("plate_length", "m", above(0)).value_or(0.0);
          if (m.has("plate_diameter"))
            source_.problem(*node->find("plate_diameter"), m.key("plate_diameter"), "is given for a rectangular plate", "plate_shape: circle");
          // Width is the short side: the fits divide by it.
          if (plate.plate_length > 0 && plate.plate_width > plate.plate_length) {
            std::swap(plate.plate_width, plate.plate_length);
            source_.note(*node, key, "plate_width is the longer side: the two are swapped");
          }
        }
        plate.file = name;
        plate.rate = rate;
      } else if (kind) {
        if (m.need("normal_stress")) shear.normal_stress = m.number("normal_stress", "Pa", at_least(0)).value_or(0.0);
        shear.file = name;
        shear.rate = rate;
      }
      const ReadingRule rule = read_reading_rule(m, without_columns(rule_));
      keep_rest(m, key);
      if (!kind || name.empty()) continue;
      const Node& where = *node->find("file");
      try {
        CsvTable table = recording::read_columns(inside(name), rule);
        rename(table, rule);
        out_.problems.insert(out_.problems.end(), table.problems.begin(), table.problems.end());
        const auto x = recording::column_in_si(table, pressure ? "sinkage" : "shear_displacement", "m", out_.problems);
        const auto y = recording::column_in_si(table, pressure ? "pressure" : "shear_stress", "Pa", out_.problems);
        for (const CsvColumn& c : table.columns)
          if (c.name != "sinkage" && c.name != "pressure" && c.name != "shear_displacement" && c.name != "shear_stress" && !c.name.empty())
            file_remarks_.push_back({table.file, fmt::format("column '{}' is not known: ignored", c.name)});
        if (!x || !y) continue;
        auto& into_x = pressure ? plate.sinkage : shear.shear_displacement;
        auto& into_y = pressure ? plate.pressure : shear.shear_stress;
        std::size_t dropped = 0;
        for (std::size_t i = 0; i < x->size(); ++i) {
          if (std::isfinite((*x)[i]) && std::isfinite((*y)[i])) {
            into_x.push_back((*x)[i]);
            into_y.push_back((*y)[i]);
          } else {
            ++dropped;
          }
        }
        if (dropped > 0) out_.recording.remarks.push_back(fmt::format("{}: {} rows with empty cells are left out", table.file, dropped));
        if (into_x.size() < 3)
          out_.problems.push_back({table.file, 0, 0, {}, fmt::format("has {} usable rows", into_x.size()), "at least 3"});
        if (pressure) out_.recording.pressure_sinkage.push_back(std::move(plate));
        else out_.recording.direct_shear.push_back(std::move(shear));
      } catch (const InputError& e) {
        add_located(e, where, m.key("file"));
      }
    }
  }

  static ReadingRule without_columns(ReadingRule rule) {
    rule.columns.clear();
    rule.sample_rate.reset();
    return rule;
  }

  // A soil test's own column map: the columns take the names they mean.
  static void rename(CsvTable& table, const ReadingRule& rule) {
    for (const recording::ColumnUse& use : rule.columns) {
      std::size_t at = table.columns.size();
      for (std::size_t i = 0; i < table.columns.size(); ++i)
        if (table.columns[i].name == use.column || std::to_string(i + 1) == use.column) {
          at = i;
          break;
        }
      if (at == table.columns.size()) {
        table.problems.push_back({table.file, table.header_line, 0, use.channel, fmt::format("has no column '{}'", use.column), {}});
        continue;
      }
      CsvColumn& c = table.columns[at];
      c.name = use.channel;
      if (use.unit) {
        c.unit = *use.unit;
        c.has_unit = true;
      }
      for (double& v : c.values) v = use.sign * use.scale * v;
    }
  }

  void read_run_files() {
    std::vector<Run>& runs = out_.recording.runs;
    if (pending_.size() != runs.size()) return;
    struct Result {
      Problems problems;
      std::vector<Remark> remarks;
      std::optional<InputError> refused;
    };
    std::vector<Result> results(runs.size());
    parallel_for(runs.size(), threads_, [&](std::size_t i) {
      if (runs[i].file.empty()) return;
      try {
        const CsvTable table = recording::read_columns(inside(runs[i].file), pending_[i].rule);
        recording::fill_run(table, pending_[i].rule, runs[i], results[i].problems, results[i].remarks);
      } catch (const InputError& e) {
        results[i].refused = e;
      }
    });
    for (std::size_t i = 0; i < runs.size(); ++i) {
      const Node* where = pending_[i].node->find("file");
      if (results[i].refused) add_located(*results[i].refused, where ? *where : *pending_[i].node, pending_[i].key + ".file");
      out_.problems.insert(out_.problems.end(), results[i].problems.begin(), results[i].problems.end());
      file_remarks_.insert(file_remarks_.end(), results[i].remarks.begin(), results[i].remarks.end());
    }
    subtract_tares();
    for (const std::ptrdiff_t i : pending_slip_) settle_from_channels(runs[static_cast<std::size_t>(i)], pending_[static_cast<std::size_t>(i)].keys);
  }

  // A tare run is one without soil contact: its mean in drawbar pull, driving torque and normal load is what the
  // sensors show without load. (Subtracting from the load assumes that it was zero.)
  void subtract_tares() {
    std::map<std::string, Run> tares;
    std::vector<Run>& runs = out_.recording.runs;
    for (std::size_t i = 0; i < runs.size(); ++i) {
      const std::string& name = pending_[i].tare;
      if (name.empty() || runs[i].file.empty() || runs[i].time.empty()) continue;
      auto found = tares.find(name);
      if (found == tares.end()) {
        Run tare;
        std::vector<Remark> ignored;
        try {
          const CsvTable table = recording::read_columns(inside(name), pending_[i].rule);
          recording::fill_run(table, pending_[i].rule, tare, out_.problems, ignored);
        } catch (const InputError& e) {
          const Node* where = pending_[i].node->find("tare");
          add_located(e, where ? *where : *pending_[i].node, "tare");
        }
        found = tares.emplace(name, std::move(tare)).first;
        std::string said;
        for (const char* c : {recording::channel::drawbar_pull, recording::channel::driving_torque, recording::channel::normal_load})
          if (const auto m = mean_of(found->second, c)) said += fmt::format("{}{} {:.4g} {}", said.empty() ? "" : ", ", c, *m, *recording::channel::unit_of(c));
        out_.recording.remarks.push_back(fmt::format("{}: tare subtracted: {}", inside(name), said.empty() ? "nothing" : said));
      }
      for (const char* c : {recording::channel::drawbar_pull, recording::channel::driving_torque, recording::channel::normal_load}) {
        const auto m = mean_of(found->second, c);
        if (!m) continue;
        for (recording::Channel& ch : runs[i].channels)
          if (ch.name == c)
            for (double& v : ch.values) v -= *m;
      }
    }
  }

  static std::optional<double> mean_of(const Run& run, const std::string& name) {
    const recording::Channel* c = run.find(name);
    if (!c) return std::nullopt;
    double sum = 0.0;
    std::size_t count = 0;
    for (const double v : c->values)
      if (std::isfinite(v)) {
        sum += v;
        ++count;
      }
    if (count == 0) return std::nullopt;
    return sum / static_cast<double>(count);
  }

  // A run that states no slip but measured both velocities.
  void settle_from_channels(Run& run, const RunKeys& keys) {
    recording::Condition& c = run.condition;
    const double r = out_.recording.wheel.radius;
    const auto omega = c.angular_velocity ? c.angular_velocity : mean_of(run, recording::channel::angular_velocity);
    const auto v = c.forward_velocity ? c.forward_velocity : mean_of(run, recording::channel::forward_velocity);
    if (!omega || !v || r <= 0) {
      if (run.file.empty() || !run.time.empty())
        out_.problems.push_back({keys.where_file, keys.line, 0, keys.key + "slip", "is missing",
                                 "a slip, or angular_velocity and forward_velocity"});
      return;
    }
    try {
      c.slip = bekker::slip_of_motion(*v, *omega, r);
      c.angular_velocity = omega;
      c.forward_velocity = v;
      out_.recording.remarks.push_back(fmt::format("{}: run '{}' states no slip: {:.4g} follows from its measured velocities", keys.where_file, run.id, c.slip));
    } catch (const InputError& e) {
      out_.problems.push_back({keys.where_file, keys.line, 0, keys.key + "slip", "is missing, and " + e.problems().front().message, e.problems().front().expected});
    }
  }

  void check_ids() {
    std::set<std::string> seen;
    const std::vector<Run>& runs = out_.recording.runs;
    for (std::size_t i = 0; i < runs.size(); ++i) {
      if (seen.insert(runs[i].id).second || i >= pending_.size()) continue;
      const RunKeys& k = pending_[i].keys;
      out_.problems.push_back({k.where_file, k.line, 0, k.key + "id", fmt::format("'{}' is given twice", runs[i].id), "each id once"});
    }
  }

  void add_file_remarks() {
    std::vector<std::string>& remarks = out_.recording.remarks;
    if (assumed_velocity_ > 0)
      remarks.push_back(fmt::format("{}: {} of {} runs give neither angular_velocity nor forward_velocity: {} rad/s is assumed", file_,
                                    assumed_velocity_, out_.recording.runs.size(), kAssumedAngularVelocity));
    for (const auto& [key, count] : further_keys_)
      remarks.push_back(fmt::format("{}: runs[].{} is not a known key: kept and ignored ({} runs)", file_, key, count));
    constexpr std::size_t kept = 5;
    for (std::size_t i = 0; i < std::min(kept, disagreements_.size()); ++i) remarks.push_back(disagreements_[i]);
    if (disagreements_.size() > kept)
      remarks.push_back(fmt::format("{}: {} more runs whose velocities and slip differ", file_, disagreements_.size() - kept));
    std::vector<std::pair<std::string, std::vector<std::string>>> by_text;
    for (const Remark& m : file_remarks_) {
      auto found = std::find_if(by_text.begin(), by_text.end(), [&](const auto& e) { return e.first == m.text; });
      if (found == by_text.end()) by_text.push_back({m.text, {m.file}});
      else found->second.push_back(m.file);
    }
    for (const auto& [text, files] : by_text)
      remarks.push_back(files.size() == 1 ? fmt::format("{}: {}", files.front(), text)
                                          : fmt::format("{} and {} more: {}", files.front(), files.size() - 1, text));
  }

  struct Pending {
    const Node* node = nullptr;
    std::string key;
    ReadingRule rule;
    std::string tare;
    RunKeys keys;
  };

  int threads_ = 1;
  std::string file_;
  Source source_;
  RecordingCheck out_;
  bekker::SlipConvention convention_ = bekker::SlipConvention::wong_reece;
  ReadingRule rule_;
  std::string tare_file_;
  std::vector<Pending> pending_;
  std::vector<std::ptrdiff_t> pending_slip_;
  std::vector<Remark> file_remarks_;
  std::map<std::string, std::size_t> further_keys_;
  std::vector<std::string> disagreements_;
  std::size_t assumed_velocity_ = 0;
};

char separator_of(const std::string& text) {
  if (text == "tab") return '\t';
  if (text == "space") return ' ';
  if (text == "semicolon") return ';';
  if (text == "comma") return ',';
  return text.size() == 1 ? text[0] : '\0';
}

}  // namespace

ReadingRule read_reading_rule(MapReader& reader, const ReadingRule& base) {
  ReadingRule rule = base;
  Source& source = reader.source();
  if (auto csv = reader.section("csv")) {
    if (const auto s = csv->text("separator")) {
      rule.csv.separator = separator_of(*s);
      const char c = rule.csv.separator;
      if (c == '\0' || std::isalnum(static_cast<unsigned char>(c)) || c == '.' || c == '-' || c == '+' || c == '"')
        source.problem(*csv->node().find("separator"), csv->key("separator"), fmt::format("is '{}'", *s), "comma, semicolon, tab, space, or one sign");
    }
    if (const auto s = csv->choice("decimal", {"point", "comma"})) rule.csv.decimal_comma = *s == "comma";
    if (const auto h = csv->flag("header")) rule.csv.header = *h;
    if (const auto n = csv->integer("skip_rows", 0, 1000000)) rule.csv.skip_rows = static_cast<std::size_t>(*n);
    if (const auto s = csv->text("comment")) {
      if (s->size() == 1) rule.csv.comment = (*s)[0];
      else source.problem(*csv->node().find("comment"), csv->key("comment"), fmt::format("is '{}'", *s), "one sign");
    }
    csv->finish();
  }
  if (const auto rate = reader.number("sample_rate", "Hz", above(0))) rule.sample_rate = rate;
  if (const auto group = reader.text("group")) rule.group = *group;
  if (auto columns = reader.section("columns")) {
    rule.columns.clear();
    for (const Node::Entry& e : columns->node().entries) {
      columns->know(e.key);
      recording::ColumnUse use;
      use.channel = e.key;
      const std::string key = columns->key(e.key);
      if (e.value.kind == Node::Kind::scalar) {
        const recording::HeaderName h = recording::split_header(e.value.text);
        use.column = h.name;
        if (h.has_unit) use.unit = h.unit;
      } else {
        MapReader m(e.value, key, source);
        if (m.need("column")) use.column = m.text("column").value_or("");
        use.unit = m.text("unit");
        use.sign = static_cast<double>(m.integer("sign", -1, 1).value_or(1));
        use.scale = m.number("scale", "-").value_or(1.0);
        const auto si = recording::channel::unit_of(e.key);
        use.offset = m.number("offset", si.value_or("-")).value_or(0.0);
        use.clock = m.text("clock").value_or("");
        use.torque_constant = m.number("torque_constant", "N m/A");
        m.finish();
      }
      for (Problem p : use.validate()) {
        p.file = source.file;
        p.line = e.line;
        p.column = e.column;
        p.key = key + "." + p.key;
        source.problems.push_back(std::move(p));
      }
      rule.columns.push_back(std::move(use));
    }
  }
  if (rule.csv.decimal_comma && rule.csv.separator == ',')
    source.problem(reader.node(), reader.key("csv.separator"), "is a comma, as the decimal mark is", "another separator");
  return rule;
}

RecordingCheck check_recording(const std::string& path, int threads) { return Reader(path, threads).read(); }

Recording load_recording(const std::string& path, int threads) {
  RecordingCheck check = check_recording(path, threads);
  throw_if_any(check.problems);
  return std::move(check.recording);
}

bool is_recording(const std::string& path) {
  std::error_code error;
  if (fs::is_directory(path, error)) return fs::exists(fs::path(path) / "recording.yaml", error);
  const std::string extension = fs::path(path).extension().string();
  if (extension != ".yaml" && extension != ".yml") return false;
  try {
    const Node root = read_yaml(path);
    const Node* format = root.find("format");
    return format && format->text.starts_with("recording");
  } catch (const InputError&) {
    return fs::path(path).filename() == "recording.yaml";
  }
}

Run load_table(const std::string& path, const std::string& map, std::vector<std::string>& remarks) {
  ReadingRule rule;
  if (!map.empty()) {
    Source source;
    source.file = map;
    const Node root = read_yaml(map);
    MapReader reader(root, "", source, MapReader::Unknown::error);
    rule = read_reading_rule(reader, {});
    reader.finish();
    throw_if_any(source.problems);
  }
  Run run;
  run.file = path;
  run.id = fs::path(path).stem().string();
  Problems problems;
  std::vector<Remark> notes;
  recording::fill_run(recording::read_columns(path, rule), rule, run, problems, notes);
  throw_if_any(problems);
  for (const Remark& n : notes) remarks.push_back(n.file + ": " + n.text);
  return run;
}

}  // namespace terrode::scenario
