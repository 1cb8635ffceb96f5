// The ground of a vehicle scenario: its shape before anything touched it, soils that differ from place to place, rocks.
#pragma once

#include <memory>
#include <vector>

#include "effects/effect.h"
#include "scenario/reader.h"
#include "scenario/scenario.h"
#include "terrain/soil_field.h"
#include "terrain/surface.h"
#include "vehicle/rocks.h"

namespace terrode::scenario {

// The key `surface`: one shape or a list, which are added up. Null where it is absent or wrong.
std::shared_ptr<const terrain::Surface> read_surface(const Node& node, const std::string& key, Source& source);

// The sum of a surface (may be null) and of the bed that effects shape; null where there is neither.
std::shared_ptr<const terrain::Surface> with_bed(std::shared_ptr<const terrain::Surface> surface, const effects::EffectSet& effects);

// The key `soil_map`: rectangles of other soils; what a soil does not say is that of `base`.
std::vector<terrain::SoilPatch> read_soil_map(MapReader& map, const Scenario& base);

// The keys `rocks`, `rock_field`; the field keeps clear of a circle about the machine's start.
std::vector<vehicle::RockSpec> read_rocks(MapReader& map, double clear_x, double clear_y, double clear_radius);

}  // namespace terrode::scenario
