#include "cli/sweep_result.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "analysis/steady_state.h"
#include "cli/terminal.h"
#include "scenario/ground.h"

namespace terrode::cli {
namespace {

struct Field {
  const char* name;
  double SweepPoint::*member;
};
constexpr Field kFields[] = {
    {"drawbar_pull", &SweepPoint::drawbar_pull},
    {"driving_torque", &SweepPoint::driving_torque},
    {"sinkage", &SweepPoint::sinkage},
    {"normal_load", &SweepPoint::normal_load},
    {"entry_angle", &SweepPoint::entry_angle},
    {"drawbar_pull_std", &SweepPoint::drawbar_pull_std},
    {"driving_torque_std", &SweepPoint::driving_torque_std},
    {"sinkage_std", &SweepPoint::sinkage_std},
    {"drawbar_pull_sem", &SweepPoint::drawbar_pull_sem},
    {"driving_torque_sem", &SweepPoint::driving_torque_sem},
    {"sinkage_sem", &SweepPoint::sinkage_sem},
    {"averaged_from", &SweepPoint::averaged_from},
    {"averaged_to", &SweepPoint::averaged_to},
    {"work_in", &SweepPoint::work_in},
    {"work_out", &SweepPoint::work_out},
    {"energy_plastic", &SweepPoint::energy_plastic},
    {"energy_slip", &SweepPoint::energy_slip},
    {"energy_damping", &SweepPoint::energy_damping},
    {"energy_stored", &SweepPoint::energy_stored},
    {"energy_step", &SweepPoint::energy_step},
    {"energy_audit", &SweepPoint::energy_audit},
    {"cpu_seconds", &SweepPoint::cpu_seconds},
    {"simulated_seconds", &SweepPoint::simulated_seconds},
};

std::string csv_text(const std::string& text) {
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  std::string out = "\"";
  for (const char c : text) out += c == '"' ? std::string("\"\"") : std::string(1, c == '\n' || c == '\r' ? ' ' : c);
  return out + "\"";
}

std::string csv_head(const std::string& name) {
  const std::string unit = recording::column_unit(name);
  return unit.empty() ? name : fmt::format("{} [{}]", name, unit);
}

std::string csv_number(double v) { return std::isfinite(v) ? fmt::format("{}", v) : std::string(); }

}  // namespace

bool same_point(const scenario::OperatingPoint& a, const scenario::OperatingPoint& b) {
  return a.slip == b.slip && a.normal_load == b.normal_load && a.angular_velocity == b.angular_velocity && a.pass == b.pass;
}

SweepPoint summarise(const vehicle::SweepPoint& point, const scenario::OperatingPoint& at, std::optional<double> period) {
  SweepPoint out;
  out.at = at;
  out.cpu_seconds = point.cpu_seconds;
  out.error = point.error;
  if (out.failed()) return out;
  out.remarks = point.result.events;
  const recording::Run& run = point.result.run;
  namespace channel = recording::channel;
  if (run.time.empty()) {
    const auto value = [&run](const char* name) {
      const auto found = run.steady.find(name);
      return found == run.steady.end() ? SweepPoint::kUnknown : found->second.mean;
    };
    out.drawbar_pull = value(channel::drawbar_pull);
    out.driving_torque = value(channel::driving_torque);
    out.sinkage = value(channel::sinkage);
    out.normal_load = value(channel::normal_load);
    out.entry_angle = value("entry_angle");
    return out;
  }
  out.simulated_seconds = point.result.simulated_seconds;
  if (point.result.energy) put_energy(*point.result.energy, out);
  out.series = std::make_shared<recording::Run>(run);
  analysis::SteadyOptions options;
  options.period = period;
  std::map<std::string, analysis::SteadyState> states;
  try {
    states = analysis::steady_states(run, options);
  } catch (const InputError& e) {
    out.error = fmt::format("the run is too short to average: {}", e.what());
    return out;
  }
  const auto take = [&](const char* name, double& mean, double* std, double* sem) {
    const auto found = states.find(name);
    if (found == states.end()) return;
    const analysis::SteadyState& s = found->second;
    mean = s.mean;
    if (std) *std = s.std;
    if (sem) *sem = s.sem;
    if (!std) return;
    out.averaged_from = s.begin_time;
    out.averaged_to = s.end_time;
    if (!s.reached) {
      out.steady = false;
      out.remarks.push_back(fmt::format("{} has not reached a steady state: {}", name, s.reason));
    }
  };
  take(channel::drawbar_pull, out.drawbar_pull, &out.drawbar_pull_std, &out.drawbar_pull_sem);
  take(channel::driving_torque, out.driving_torque, &out.driving_torque_std, &out.driving_torque_sem);
  take(channel::sinkage, out.sinkage, &out.sinkage_std, &out.sinkage_sem);
  take(channel::normal_load, out.normal_load, nullptr, nullptr);
  return out;
}

void put_energy(const vehicle::RigEnergy& e, SweepPoint& p) {
  p.work_in = e.work_in();
  p.work_out = e.work_out();
  p.energy_plastic = e.plastic;
  p.energy_slip = e.slip;
  p.energy_damping = e.damping;
  p.energy_stored = e.stored;
  p.energy_step = e.numerical;
  p.energy_audit = e.audit();
}

std::vector<std::pair<std::string, double>> energy_fields(const SweepPoint& p) {
  std::vector<std::pair<std::string, double>> out;
  for (const Field& f : kFields)
    if (std::string(f.name).starts_with("energy_") || std::string(f.name).starts_with("work_")) out.emplace_back(f.name, p.*f.member);
  return out;
}

std::string energy_text(const std::vector<SweepPoint>& points) {
  double in = 0, out = 0, plastic = 0, slip = 0, damping = 0, stored = 0, step = 0, worst = 0;
  int count = 0;
  for (const SweepPoint& p : points) {
    if (p.failed() || !std::isfinite(p.energy_audit)) continue;
    ++count;
    in += p.work_in;
    out += p.work_out;
    plastic += p.energy_plastic;
    slip += p.energy_slip;
    damping += p.energy_damping;
    stored += p.energy_stored;
    step += p.energy_step;
    worst = std::max(worst, std::abs(p.energy_audit));
  }
  if (count == 0 || !(in > 0.0)) return {};
  return fmt::format("work in {:.4g} J = out {:.4g} + plastic {:.4g} + slip {:.4g} + damping {:.4g} + stored {:.2g} + taken by the step {:.2g} J; "
                     "left over{} {:.2g} %",
                     in, out, plastic, slip, damping, stored, step, count > 1 ? " in the worst run" : "", 100.0 * worst);
}

std::string physics_of(scenario::Scenario s) {
  s.title.clear();
  s.methods.clear();
  s.slips.clear();
  s.conditions.clear();
  s.measured.reset();
  s.rig.slip = 0.0;
  return scenario::to_yaml(s) + scenario::ground_files(s);
}

recording::ResultTable to_table(const std::vector<SweepPoint>& points) {
  recording::ResultTable out;
  const auto column = [&](const std::string& name, auto value) {
    recording::ResultColumn c{name, recording::column_unit(name), recording::column_description(name), {}};
    for (const SweepPoint& p : points) c.values.push_back(value(p));
    out.columns.push_back(std::move(c));
  };
  column("slip", [](const SweepPoint& p) { return p.at.slip_given; });
  column("slip_wong_reece", [](const SweepPoint& p) { return p.at.slip; });
  column("normal_load_asked", [](const SweepPoint& p) { return p.at.normal_load; });
  column("angular_velocity", [](const SweepPoint& p) { return p.at.angular_velocity; });
  column("pass", [](const SweepPoint& p) { return static_cast<double>(p.at.pass); });
  for (const Field& f : kFields) column(f.name, [&f](const SweepPoint& p) { return p.*f.member; });
  column("steady", [](const SweepPoint& p) { return p.steady ? 1.0 : 0.0; });
  for (const SweepPoint& p : points) {
    out.texts["error"].push_back(p.error);
    std::string remarks;
    for (const std::string& r : p.remarks) remarks += (remarks.empty() ? "" : "\n") + r;
    out.texts["remarks"].push_back(remarks);
  }
  return out;
}

std::vector<SweepPoint> from_table(const recording::ResultTable& table) {
  std::vector<SweepPoint> out(table.rows());
  const auto fill = [&](const std::string& name, auto put) {
    if (const recording::ResultColumn* c = table.find(name))
      for (std::size_t i = 0; i < out.size(); ++i) put(out[i], c->values[i]);
  };
  fill("slip", [](SweepPoint& p, double v) { p.at.slip_given = v; });
  fill("slip_wong_reece", [](SweepPoint& p, double v) { p.at.slip = v; });
  fill("normal_load_asked", [](SweepPoint& p, double v) { p.at.normal_load = v; });
  fill("angular_velocity", [](SweepPoint& p, double v) { p.at.angular_velocity = v; });
  fill("pass", [](SweepPoint& p, double v) { p.at.pass = static_cast<int>(v); });
  for (const Field& f : kFields) fill(f.name, [&f](SweepPoint& p, double v) { p.*f.member = v; });
  fill("steady", [](SweepPoint& p, double v) { p.steady = v != 0.0; });
  if (const auto errors = table.texts.find("error"); errors != table.texts.end())
    for (std::size_t i = 0; i < out.size(); ++i) out[i].error = errors->second[i];
  if (const auto remarks = table.texts.find("remarks"); remarks != table.texts.end()) {
    for (std::size_t i = 0; i < out.size(); ++i) {
      std::string rest = remarks->second[i];
      while (!rest.empty()) {
        const std::size_t end = rest.find('\n');
        out[i].remarks.push_back(rest.substr(0, end));
        rest = end == std::string::npos ? "" : rest.substr(end + 1);
      }
    }
  }
  return out;
}

static Json point_json(const SweepPoint& p) {
  Json point = {{"slip", number(p.at.slip_given)}};
  if (p.failed()) {
    point["normal_load"] = number(p.at.normal_load);
  } else {
    for (const Field& f : kFields)
      if (std::isfinite(p.*f.member)) point[f.name] = p.*f.member;
    if (!point.contains("normal_load")) point["normal_load"] = number(p.at.normal_load);
  }
  point["angular_velocity"] = number(p.at.angular_velocity);
  if (p.at.pass != 1) point["pass"] = p.at.pass;
  if (p.failed())
    point["error"] = p.error;
  else
    point["steady"] = p.steady;
  if (!p.remarks.empty()) point["remarks"] = p.remarks;
  return point;
}

Json sweep_json(const std::string& scenario_file, const std::string& slip_convention,
                const std::vector<MethodResult>& results, const std::vector<SweepPoint>& measured) {
  Json out = {{"scenario", scenario_file}, {"slip_convention", slip_convention}, {"results", Json::array()}};
  for (const MethodResult& r : results) {
    Json points = Json::array();
    for (const SweepPoint& p : r.points) points.push_back(point_json(p));
    out["results"].push_back({{"method", r.method}, {"points", std::move(points)}});
  }
  if (!measured.empty()) {
    out["measured"] = Json::array();
    for (const SweepPoint& p : measured) out["measured"].push_back(point_json(p));
  }
  return out;
}

std::string sweep_csv(const std::vector<MethodResult>& results) {
  std::string out = "method,slip,angular_velocity [rad/s],pass";
  for (const Field& f : kFields) out.append(",").append(csv_head(f.name));
  out += ",steady,error\n";
  for (const MethodResult& r : results) {
    for (const SweepPoint& p : r.points) {
      out += fmt::format("{},{},{},{}", csv_text(r.method), csv_number(p.at.slip_given), csv_number(p.at.angular_velocity), p.at.pass);
      for (const Field& f : kFields)
        out.append(",").append(csv_number(p.failed() && std::string(f.name) == "normal_load" ? p.at.normal_load : p.*f.member));
      out += fmt::format(",{},{}\n", p.failed() ? "" : p.steady ? "1" : "0", csv_text(p.error));
    }
  }
  return out;
}

std::string sweep_text(const std::vector<MethodResult>& results) {
  bool loads = false, speeds = false, passes = false, scatter = false;
  const SweepPoint* first = nullptr;
  for (const auto& r : results) {
    for (const SweepPoint& p : r.points) {
      if (!first) first = &p;
      loads = loads || p.at.normal_load != first->at.normal_load;
      speeds = speeds || p.at.angular_velocity != first->at.angular_velocity;
      passes = passes || p.at.pass != first->at.pass;
      scatter = scatter || std::isfinite(p.drawbar_pull_sem);
    }
  }
  std::vector<std::vector<std::string>> rows;
  std::vector<std::string> head = {"method", "slip"};
  if (loads) head.push_back("load [N]");
  if (speeds) head.push_back("speed [rad/s]");
  if (passes) head.push_back("pass");
  const auto channel = [&](const std::string& name) {
    head.push_back(name);
    if (scatter) head.push_back("+-");
  };
  channel("drawbar pull [N]");
  channel("torque [N m]");
  channel("sinkage [mm]");
  head.push_back("");
  rows.push_back(head);
  for (const auto& r : results) {
    for (const SweepPoint& p : r.points) {
      std::vector<std::string> row = {r.method, fmt::format("{:.4g}", p.at.slip_given)};
      if (loads) row.push_back(fmt::format("{:.4g}", p.at.normal_load));
      if (speeds) row.push_back(fmt::format("{:.4g}", p.at.angular_velocity));
      if (passes) row.push_back(std::to_string(p.at.pass));
      const auto put = [&](double value, double sem, double scale, int digits) {
        row.push_back(std::isfinite(value) ? fmt::format("{:.{}f}", value * scale, digits) : "-");
        if (scatter) row.push_back(std::isfinite(sem) ? fmt::format("{:.{}f}", sem * scale, digits) : "-");
      };
      put(p.drawbar_pull, p.drawbar_pull_sem, 1.0, 3);
      put(p.driving_torque, p.driving_torque_sem, 1.0, 4);
      put(p.sinkage, p.sinkage_sem, 1e3, 3);
      row.push_back(p.failed() ? "failed: " + p.error : p.steady ? "" : "not settled");
      rows.push_back(row);
    }
  }
  return aligned(rows);
}

}  // namespace terrode::cli
