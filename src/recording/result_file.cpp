#include "recording/result_file.h"

#include <fmt/format.h>
#include <time.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "core/version.h"

namespace terrode::recording {
namespace {

struct Known {
  const char *name, *unit, *description;
};
constexpr Known kKnown[] = {
    {"time", "s", "time from the start of the run"},
    {"slip", "", "slip by the slip_convention of the file"},
    {"slip_wong_reece", "", "s = 1 - v/(omega r); -inf for a locked wheel"},
    {"drawbar_pull", "N", "horizontal force of the wheel on its carriage, positive forward"},
    {"driving_torque", "N m", "torque on the wheel about its axle, positive driving"},
    {"sinkage", "m", "lowest point of the rim below the undisturbed surface"},
    {"normal_load", "N", "vertical force on the soil"},
    {"normal_load_asked", "N", "vertical force that was asked for"},
    {"angular_velocity", "rad/s", "of the wheel"},
    {"forward_velocity", "m/s", "of the axle"},
    {"position", "m", "of the axle along the travel"},
    {"wheel_angle", "rad", "how far the wheel has turned"},
    {"entry_angle", "rad", "where contact begins, from straight down, positive in front"},
    {"pass", "", "how often the ground was driven over, this pass included"},
    {"averaged_from", "s", "beginning of the averaging window"},
    {"averaged_to", "s", "end of the averaging window"},
    {"vertical_velocity", "m/s", "of the axle, positive upwards"},
    {"lateral_force", "N", "of the ground on the wheel, along y"},
    {"compaction_resistance", "N", "horizontal part of the normal stress, positive against the motion"},
    {"contact_count", "", "nodes or particles that carry load"},
    {"work_in", "J", "net work of whichever of axle motor, carriage, load and gravity gave some, touchdown included"},
    {"work_out", "J", "net work of whichever of them took some, and the kinetic energy at the end"},
    {"energy_plastic", "J", "that the ground took by compaction and soil pushed aside"},
    {"energy_slip", "J", "that the ground took by shear along the wheel's surface"},
    {"energy_damping", "J", "that the ground took by its dashpots"},
    {"energy_stored", "J", "elastic energy in the ground at the end"},
    {"energy_step", "J", "that the implicit part of the time step took"},
    {"energy_audit", "", "what is left of work_in after all that, over work_in"},
    {"cpu_seconds", "s", "processor time of the computation"},
    {"simulated_seconds", "s", "time that was simulated"},
    {"steady", "", "1: the run had settled before the averaging window, 0: it had not"},
};

std::string without(const std::string& name, const std::string& suffix) {
  return name.ends_with(suffix) ? name.substr(0, name.size() - suffix.size()) : std::string();
}

}  // namespace

std::string column_unit(const std::string& name) {
  for (const Known& k : kKnown)
    if (name == k.name) return k.unit;
  for (const char* suffix : {"_std", "_sem"})
    if (const std::string base = without(name, suffix); !base.empty()) return column_unit(base);
  return {};
}

std::string column_description(const std::string& name) {
  for (const Known& k : kKnown)
    if (name == k.name) return k.description;
  if (const std::string base = without(name, "_std"); !base.empty()) return "standard deviation over the averaging window of " + base;
  if (const std::string base = without(name, "_sem"); !base.empty()) return "standard error of the mean, autocorrelation counted, of " + base;
  return name;
}

ResultHeader ResultHeader::now(std::string filetype) {
  ResultHeader out;
  out.filetype = std::move(filetype);
  out.generator = fmt::format("terrode {} ({})", version(), commit());
  const time_t seconds = time(nullptr);
  tm utc{};
  gmtime_r(&seconds, &utc);
  std::array<char, 32> text{};
  strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%SZ", &utc);
  out.created = text.data();
  return out;
}

std::size_t ResultTable::rows() const {
  if (!columns.empty()) return columns.front().values.size();
  return texts.empty() ? 0 : texts.begin()->second.size();
}

const ResultColumn* ResultTable::find(const std::string& name) const {
  for (const ResultColumn& c : columns)
    if (c.name == name) return &c;
  return nullptr;
}

void write_header(Hdf5File& file, const ResultHeader& h) {
  file.set_attribute("/", "filetype", h.filetype);
  file.set_attribute("/", "schema_version", std::vector<double>{kResultSchemaVersion[0], kResultSchemaVersion[1]});
  file.set_attribute("/", "generator", h.generator);
  file.set_attribute("/", "created", h.created);
  file.set_attribute("/", "title", h.title);
  file.set_attribute("/", "scenario_file", h.scenario_file);
  file.set_attribute("/", "scenario_text", h.scenario_text);
  file.set_attribute("/", "scenario_resolved", h.scenario_resolved);
  file.set_attribute("/", "slip_convention", h.slip_convention);
  file.set_attribute("/", "command", h.command);
  file.set_attribute("/", "seed", h.seed);
}

ResultHeader read_header(const Hdf5File& file) {
  const auto version = file.numbers_attribute("/", "schema_version");
  const auto filetype = file.text_attribute("/", "filetype");
  if (!filetype || !filetype->starts_with("terrode ") || !version || version->size() != 2)
    throw InputError({file.path(), 0, 0, {}, "is an HDF5 file, but no result of terrode", "a file written by terrode"});
  if ((*version)[0] > kResultSchemaVersion[0])
    throw InputError({file.path(), 0, 0, "schema_version", fmt::format("is {}.{}", (*version)[0], (*version)[1]),
                      fmt::format("at most {}: a newer terrode wrote this file", kResultSchemaVersion[0])});
  ResultHeader h;
  const auto text = [&](const char* name) { return file.text_attribute("/", name).value_or(""); };
  h.filetype = *filetype;
  h.generator = text("generator");
  h.created = text("created");
  h.title = text("title");
  h.scenario_file = text("scenario_file");
  h.scenario_text = text("scenario_text");
  h.scenario_resolved = text("scenario_resolved");
  h.slip_convention = text("slip_convention");
  h.command = text("command");
  h.seed = static_cast<std::int64_t>(file.number_attribute("/", "seed").value_or(1.0));
  return h;
}

void write_table(Hdf5File& file, const std::string& group, const ResultTable& table) {
  if (!file.exists(group)) file.create_group(group);
  for (const ResultColumn& c : table.columns) {
    const std::string path = group + "/" + c.name;
    if (file.exists(path)) file.remove(path);
    file.write(path, c.values);
    file.set_attribute(path, "unit", c.unit);
    file.set_attribute(path, "description", c.description);
  }
  for (const auto& [name, values] : table.texts) {
    const std::string path = group + "/" + name;
    if (file.exists(path)) file.remove(path);
    file.write_text(path, values);
  }
}

ResultTable read_table(const Hdf5File& file, const std::string& group) {
  ResultTable out;
  for (const std::string& name : file.children(group)) {
    const std::string path = group + "/" + name;
    if (!file.is_array(path) || file.shape(path).size() != 1) continue;
    if (file.is_numeric(path)) {
      out.columns.push_back({name, file.text_attribute(path, "unit").value_or(""),
                             file.text_attribute(path, "description").value_or(""), file.read<double>(path).values});
    } else {
      out.texts[name] = file.read_text(path);
    }
  }
  for (const ResultColumn& c : out.columns)
    if (c.values.size() != out.rows())
      throw InputError({file.path(), 0, 0, group + "/" + c.name, fmt::format("has {} rows", c.values.size()),
                        fmt::format("{} rows as its neighbours", out.rows())});
  return out;
}

void write_series(Hdf5File& file, const std::string& group, const Run& run) {
  ResultTable table;
  table.columns.push_back({"time", "s", column_description("time"), run.time});
  for (const Channel& c : run.channels) table.columns.push_back({c.name, c.unit, column_description(c.name), c.values});
  write_table(file, group, table);
}

Run read_series(const Hdf5File& file, const std::string& group) {
  Run run;
  for (ResultColumn& c : read_table(file, group).columns) {
    if (c.name == "time")
      run.time = std::move(c.values);
    else
      run.channels.push_back({c.name, c.unit, std::move(c.values)});
  }
  if (run.time.empty() && !run.channels.empty())
    throw InputError({file.path(), 0, 0, group, "has no times", "a dataset 'time'"});
  return run;
}

std::string series_csv(const Run& run) {
  std::string out = "time [s]";
  for (const Channel& c : run.channels) out += "," + (c.unit.empty() ? c.name : fmt::format("{} [{}]", c.name, c.unit));
  out += "\n";
  for (std::size_t i = 0; i < run.time.size(); ++i) {
    out += fmt::format("{}", run.time[i]);
    for (const Channel& c : run.channels) out += std::isfinite(c.values[i]) ? fmt::format(",{}", c.values[i]) : ",";
    out += "\n";
  }
  return out;
}

std::vector<std::string> result_methods(const Hdf5File& file) {
  std::vector<std::string> out;
  if (file.is_group("/sweep")) out = file.children("/sweep");
  if (file.is_group("/run")) out.push_back("run");
  return out;
}

Recording read_result(const std::string& path, const std::string& method) {
  const Hdf5File file = Hdf5File::open(path);
  const ResultHeader header = read_header(file);
  const std::vector<std::string> methods = result_methods(file);
  std::string list;
  for (const std::string& m : methods) list += (list.empty() ? "" : ", ") + m;
  if (methods.empty()) throw InputError({path, 0, 0, {}, "holds no results yet", {}});
  if (method.empty() && methods.size() > 1)
    throw InputError({path, 0, 0, "method", "is not named and the file holds several", "one of " + list});
  const std::string wanted = method.empty() ? methods.front() : method;
  if (std::find(methods.begin(), methods.end(), wanted) == methods.end())
    throw InputError({path, 0, 0, "method", fmt::format("'{}' is not in the file", wanted), "one of " + list});

  Recording out;
  out.title = header.title.empty() ? header.scenario_file : header.title;
  out.source = header.generator + ", " + wanted;
  out.slip_convention = "s = 1 - v/(omega r)";
  if (wanted == "run") {
    Run run = read_series(file, "/run");
    run.id = "run";
    run.condition.slip = file.number_attribute("/run", "slip_wong_reece").value_or(0.0);
    if (const auto load = file.number_attribute("/run", "normal_load")) run.condition.normal_load = *load;
    if (const auto speed = file.number_attribute("/run", "angular_velocity")) run.condition.angular_velocity = *speed;
    out.runs.push_back(std::move(run));
    return out;
  }
  const std::string group = "/sweep/" + wanted;
  const ResultTable table = read_table(file, group);
  const auto errors = table.texts.find("error");
  for (std::size_t i = 0; i < table.rows(); ++i) {
    if (errors != table.texts.end() && !errors->second[i].empty()) continue;
    const auto value = [&](const char* name) {
      const ResultColumn* c = table.find(name);
      return c ? c->values[i] : std::nan("");
    };
    Run run;
    const std::string series = fmt::format("{}/runs/{:04}", group, i);
    if (file.is_group(series)) run = read_series(file, series);
    run.id = fmt::format("{:04}", i);
    run.condition.slip = value("slip_wong_reece");
    if (const double load = value("normal_load_asked"); std::isfinite(load)) run.condition.normal_load = load;
    if (const double speed = value("angular_velocity"); std::isfinite(speed)) run.condition.angular_velocity = speed;
    if (const double pass = value("pass"); std::isfinite(pass)) run.condition.pass = static_cast<int>(pass);
    for (const char* name : {channel::drawbar_pull, channel::driving_torque, channel::sinkage, channel::normal_load}) {
      const double mean = value(name), std = value((std::string(name) + "_std").c_str());
      if (std::isfinite(mean)) run.steady[name] = {mean, std::isfinite(std) ? std::optional(std) : std::nullopt};
    }
    out.runs.push_back(std::move(run));
  }
  return out;
}

}  // namespace terrode::recording
