// Size distributions, preparation, tiling, files and the cache of beds.
#include "dem/bed.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>

#include "recording/hdf5_file.h"

namespace terrode::dem {
namespace {

constexpr int samples = 40000;
constexpr double sampling_error = 0.015;  // of a mean over 40,000

TEST(SizeDistribution, MeansFollowFromTheDensity) {
  SizeDistribution s;
  Random random(1);
  const auto mean = [&](auto f) {
    double sum = 0.0;
    for (int k = 0; k < samples; ++k) sum += f(s.sample(random));
    return sum / samples;
  };
  const auto diameter = [](double d) { return d; };
  EXPECT_NEAR(mean(diameter) / 6.25e-3, 1.0, sampling_error);
  s.shape = "linear";  // p ~ d: mean = 2/3 (b^3 - a^3)/(b^2 - a^2)
  EXPECT_NEAR(mean(diameter) / (2.0 / 3.0 * (1e3 - 15.625) / (100 - 6.25) * 1e-3), 1.0, sampling_error);
  s.by = "mass";
  const double volume = s.mean_volume();
  EXPECT_NEAR(mean([](double d) { return M_PI / 6 * d * d * d; }) / volume, 1.0, 3 * sampling_error);
  s.shape = "listed";
  s.by = "number";
  s.diameters = {1e-3, 2e-3};
  s.shares = {3, 1};
  EXPECT_NEAR(mean(diameter) / 1.25e-3, 1.0, sampling_error);
  s.shares = {1};
  EXPECT_EQ(s.validate().size(), 1u);
}

BedRecipe small_recipe() {
  BedRecipe r;
  r.width = r.length = 0.02;
  r.height = 0.025;
  r.sizes.smallest = 3e-3;
  r.sizes.largest = 4e-3;
  return r;
}

TEST(Bed, PreparedTiledSavedCached) {
  const auto folder = std::filesystem::temp_directory_path() / ("terrode_bed_" + std::to_string(::getpid()));
  std::filesystem::remove_all(folder);
  const BedRecipe recipe = small_recipe();
  const Bed bed = cached_bed(recipe, folder.string());
  EXPECT_NEAR(bed.bulk_density, 1600.0, 1e-6);
  EXPECT_GT(bed.solid_fraction, 0.45);
  EXPECT_LT(bed.solid_fraction, 0.62);
  EXPECT_GT(bed.coordination, 2.5);
  for (const Grain& g : bed.grains) {
    EXPECT_GT(g.position.z(), 0.99 * g.radius);
    EXPECT_LT(g.position.z(), recipe.height * 1.05);
    EXPECT_GE(g.radius, 1.5e-3);
    EXPECT_LE(g.radius, 2e-3);
  }
  // The second time it is read; a file gives back every bit.
  const Bed again = cached_bed(recipe, folder.string());
  ASSERT_EQ(again.grains.size(), bed.grains.size());
  for (std::size_t k = 0; k < bed.grains.size(); ++k) EXPECT_EQ(again.grains[k].position, bed.grains[k].position);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder), std::filesystem::directory_iterator()), 1);

  // What H5MD 1.1 asks of a file.
  const auto path = std::filesystem::directory_iterator(folder)->path().string();
  const auto file = recording::Hdf5File::open(path);
  EXPECT_EQ(file.numbers_attribute("/h5md", "version"), (std::vector<double>{1, 1}));
  for (const char* group : {"/h5md/author", "/h5md/creator"}) EXPECT_TRUE(file.text_attribute(group, "name")) << group;
  EXPECT_EQ(file.number_attribute("/particles/soil/box", "dimension"), 3.0);
  EXPECT_EQ(file.attributes("/particles/soil/box"), (std::vector<std::string>{"boundary", "dimension"}));
  EXPECT_EQ(file.read<double>("/particles/soil/box/edges").values.size(), 3u);
  EXPECT_EQ(file.shape("/particles/soil/position"), (std::vector<std::size_t>{bed.grains.size(), 3}));
  EXPECT_EQ(file.shape("/particles/soil/mass"), (std::vector<std::size_t>{bed.grains.size()}));

  const Bed tiled = tile(bed, 2, 3);
  EXPECT_EQ(tiled.grains.size(), 6 * bed.grains.size());
  EXPECT_NEAR(tiled.length, 0.06, 1e-15);
  // A tiled bed rests like its prism: no grain moves far in a moment.
  Settings s;
  s.period = Vec3(tiled.width, tiled.length, 0);
  Simulation sim(s);
  const int m = sim.add_material(bed.grain);
  const int w = sim.add_material({"wall"});
  sim.set_interaction(m, m, recipe.contact);
  sim.set_interaction(m, w, recipe.floor);
  sim.add_surface(sim.add_body({}), make_plane(Vec3::UnitZ(), 0), w);
  add_bed(sim, tiled, m);
  sim.run(1000);
  EXPECT_LT(sim.largest_speed(), 0.15);
  std::filesystem::remove_all(folder);
}

TEST(Bed, SmoothGrainsPackDenselyAndTheirBedIsTheSameForAnyFrictionLater) {
  const Bed loose = prepare_bed(small_recipe());
  BedRecipe smooth = small_recipe();
  smooth.settling_friction = 0.05;
  smooth.settling_rolling_friction = 0.0;
  const Bed dense = prepare_bed(smooth);
  EXPECT_GT(dense.solid_fraction, loose.solid_fraction + 0.03);
  EXPECT_GT(dense.coordination, loose.coordination + 0.7);  // fewer forces keep a smooth grain in place
  // Nothing of the friction that it gets afterwards is in the bed.
  BedRecipe other = smooth;
  other.contact.friction = 0.3;
  other.contact.rolling_friction = 0.1;
  EXPECT_EQ(other.text(), smooth.text());
  EXPECT_NE(smooth.text(), small_recipe().text());
  other.settling_friction = -1.0;
  ASSERT_EQ(other.validate().size(), 1u);
  EXPECT_EQ(other.validate().front().key, "settling_friction");
}

TEST(Bed, WrongInputIsNamed) {
  BedRecipe r = small_recipe();
  r.height = -1;
  r.contact.rolling = "x";
  EXPECT_EQ(r.validate().size(), 2u);
  EXPECT_THROW(prepare_bed(r), InputError);
  EXPECT_THROW(load_bed("/nowhere.h5"), InputError);
  BedRecipe other = small_recipe();
  other.seed = 2;
  EXPECT_NE(other.text(), small_recipe().text());
}

}  // namespace
}  // namespace terrode::dem
