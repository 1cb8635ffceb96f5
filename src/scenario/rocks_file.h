// The rocks of a vehicle scenario.
#pragma once

#include <vector>

#include "scenario/reader.h"
#include "scenario/table.h"
#include "vehicle/rocks.h"

namespace terrode::scenario {

// The keys `rocks`, `rock_field`; the field keeps clear of a circle about the machine's start.
std::vector<vehicle::RockSpec> read_rocks(MapReader& map, double clear_x, double clear_y, double clear_radius);

// JSON Schema of the two.
Json rocks_schema();
Json rock_field_schema();

}  // namespace terrode::scenario
