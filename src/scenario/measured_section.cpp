#include <fmt/format.h>

#include <filesystem>

#include "scenario/recording_file.h"
#include "scenario/section.h"

namespace terrode::scenario {
namespace {

struct MeasuredRow {
  double slip = 0.0;  // by the convention of the scenario
  std::optional<double> normal_load, angular_velocity;
  std::optional<double> drawbar_pull, driving_torque, sinkage;
  std::optional<double> drawbar_pull_std, driving_torque_std, sinkage_std;
};

Table<MeasuredRow> row_table() {
  Table<MeasuredRow> t;
  t.number("slip", "-", any_number(), &MeasuredRow::slip, "by the slip convention of the rig")
      .required()
      .number("normal_load", "N", above(0), &MeasuredRow::normal_load, "absent: that of the rig")
      .number("angular_velocity", "rad/s", above(0), &MeasuredRow::angular_velocity, "absent: that of the rig")
      .number("drawbar_pull", "N", any_number(), &MeasuredRow::drawbar_pull, "positive when the wheel pulls forward")
      .number("driving_torque", "N m", any_number(), &MeasuredRow::driving_torque, "positive when it drives")
      .number("sinkage", "m", any_number(), &MeasuredRow::sinkage, "positive downwards")
      .number("drawbar_pull_std", "N", at_least(0), &MeasuredRow::drawbar_pull_std, "scatter")
      .number("driving_torque_std", "N m", at_least(0), &MeasuredRow::driving_torque_std, "scatter")
      .number("sinkage_std", "m", at_least(0), &MeasuredRow::sinkage_std, "scatter");
  return t;
}

}  // namespace

Section measured_section() {
  Section section;
  section.name = "measured";
  section.read = [](const Node& node, const std::string& key, Source& source, Scenario& out) {
    if (node.kind == Node::Kind::scalar) {
      const std::size_t before = source.problems.size();
      out.measured_file = named_path(node.text, node, key, source);
      if (source.problems.size() > before) return;
      try {
        out.measured = load_recording(out.measured_file);
      } catch (const InputError& e) {
        source.problem(node, key, fmt::format("names the recording '{}', which cannot be read", out.measured_file));
        source.problems.insert(source.problems.end(), e.problems().begin(), e.problems().end());
      }
      return;
    }
    recording::Recording measured;
    MapReader map(node, key, source);
    if (const auto text = map.text("source")) measured.source = *text;
    map.need("table");
    for (const auto& [item_key, item] : map.items("table")) {
      MapReader below(*item, item_key, source);
      MeasuredRow row;
      row_table().read(below, row);
      recording::Run run;
      run.id = item_key;
      run.condition.slip = row.slip;  // turned to s = 1 - v/(omega r) when the whole scenario is known
      run.condition.normal_load = row.normal_load;
      run.condition.angular_velocity = row.angular_velocity;
      const auto put = [&run](const char* name, std::optional<double> mean, std::optional<double> std) {
        if (mean) run.steady[name] = {*mean, std};
      };
      put(recording::channel::drawbar_pull, row.drawbar_pull, row.drawbar_pull_std);
      put(recording::channel::driving_torque, row.driving_torque, row.driving_torque_std);
      put(recording::channel::sinkage, row.sinkage, row.sinkage_std);
      if (run.steady.empty() && item->kind == Node::Kind::map)
        source.problem(*item, item_key, "has no measured channel", "one of drawbar_pull, driving_torque, sinkage");
      measured.runs.push_back(std::move(run));
    }
    map.finish();
    out.measured = std::move(measured);
  };
  section.write = [](const Scenario& in) -> std::optional<Node> {
    if (!in.measured || in.from_recording) return std::nullopt;
    if (!in.measured_file.empty()) return Node::scalar(std::filesystem::absolute(in.measured_file).lexically_normal().string());
    Node out = Node::map();
    if (!in.measured->source.empty()) out.set("source", Node::scalar(in.measured->source));
    Node& table = out.set("table", Node::sequence());
    const auto convention = in.slip_convention();
    for (const recording::Run& run : in.measured->runs) {
      MeasuredRow row;
      row.slip = bekker::from_wong_reece(run.condition.slip, convention);
      row.normal_load = run.condition.normal_load;
      row.angular_velocity = run.condition.angular_velocity;
      const auto get = [&run](const char* name, std::optional<double>& mean, std::optional<double>& std) {
        const auto found = run.steady.find(name);
        if (found == run.steady.end()) return;
        mean = found->second.mean;
        std = found->second.std;
      };
      get(recording::channel::drawbar_pull, row.drawbar_pull, row.drawbar_pull_std);
      get(recording::channel::driving_torque, row.driving_torque, row.driving_torque_std);
      get(recording::channel::sinkage, row.sinkage, row.sinkage_std);
      table.items.push_back(row_table().write(row));
    }
    return out;
  };
  section.schema = [] {
    const Json table = {{"type", "object"},
                        {"additionalProperties", false},
                        {"properties", {{"source", {{"type", "string"}}}, {"table", {{"type", "array"}, {"items", row_table().schema()}}}}},
                        {"required", Json::array({"table"})}};
    return Json{{"description", "measured points to compare with, or the path of a recording"},
                {"anyOf", Json::array({Json{{"type", "string"}}, table})}};
  };
  return section;
}

}  // namespace terrode::scenario
