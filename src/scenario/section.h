// One top-level section of a scenario file: how it is read into a Scenario, written from it, and described. A new
// section is a file that returns one of these, and a line in scenario.cpp.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "scenario/scenario.h"
#include "scenario/table.h"

namespace terrode::scenario {

struct Section {
  std::string name;
  bool required = false;
  // `key` is the name for messages; paths in the section are relative to the folder of source.file.
  std::function<void(const Node& node, const std::string& key, Source& source, Scenario& out)> read;
  std::function<std::optional<Node>(const Scenario& in)> write;  // nothing: the section is left out
  std::function<Json()> schema;
};

Section soil_section();
Section wheel_section();
Section rig_section();
Section terrain_section();
Section particles_section();
Section effects_section();
Section laws_section();
Section surface_section();
Section soil_map_section();
Section soil_layers_section();
Section sweep_section();
Section measured_section();

// Calls `read` with the section itself, or, where the value is text, with the content of the file it names.
void inline_or_file(const Node& node, const std::string& key, Source& source,
                    const std::function<void(const Node&, const std::string& key, Source&)>& read);

// The key tables, for files of their own (a soil file) and for the schema.
Table<recording::SoilBelief> soil_table();
Table<WheelSpec> wheel_table();
Table<WheelSpec> grouser_table();

// One effect with its parameters from a map of them; finish() is left to the caller. And its parameters' schema.
EffectSpec read_effect(const std::string& id, MapReader& parameters);
Json effect_parameters_schema(const std::string& id);

// What is missing or contradictory in a soil for a model to run on it; keys as in the file ("bekker.k").
Problems check_soil(const recording::SoilBelief& soil);

}  // namespace terrode::scenario
