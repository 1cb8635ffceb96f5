// The ground of a scenario, for rigs and vehicles alike: its shape before anything touched it, soils that differ from
// place to place and with depth, and the laws by which it answers.
#pragma once

#include <memory>
#include <vector>

#include "bekker/point_law.h"
#include "effects/effect.h"
#include "scenario/scenario.h"
#include "terrain/soil_field.h"
#include "terrain/surface.h"

namespace terrode::scenario {

// The sum of the parts; null where all of them are level at 0. Throws InputError (a file that is no heightfield, ...).
std::shared_ptr<const terrain::Surface> make_surface(const std::vector<SurfacePart>& parts);

// The sum of a surface (may be null) and of the bed that effects shape; null where there is neither.
std::shared_ptr<const terrain::Surface> with_bed(std::shared_ptr<const terrain::Surface> surface, const effects::EffectSet& effects);

// How the soil varies by `soil_layers` and `soil_map`; null where it does not. Throws InputError naming file and key.
std::shared_ptr<const terrain::SoilField> soil_field(const Scenario& scenario);

// The laws of pressure and shear by their names, without effects; `owner` keeps them alive.
struct GroundLaw {
  bekker::PointLaw law;
  std::shared_ptr<const void> owner;
};
GroundLaw point_law(const Scenario& scenario);

// As point_law(), for who knows no place: the layers are in it as modifiers. Throws InputError for ground that is shaped
// or differs from place to place.
GroundLaw placeless_law(const Scenario& scenario);

// Throws InputError where the scenario has ground that `method` does not know: of particles, surface, soil_map and
// soil_layers.
void refuse_for_particles(const Scenario& scenario, const std::string& method);

// The files that shape ground and soil, each with a digest of its bytes, one a line as comments of YAML.
std::string ground_files(const Scenario& scenario);

}  // namespace terrode::scenario
