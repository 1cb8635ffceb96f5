// Result files, checkpoints, frames, beds and recordings in HDF5.
#include "dem/bed.h"
#include "harness.h"
#include "recording/checkpoint.h"
#include "recording/columns.h"
#include "recording/frames.h"
#include "recording/result_file.h"

FUZZ(result_hdf5) {
  using namespace terrode;
  const std::string path = fuzz::as_file("fuzz.h5", data, size);
  const auto attempt = [](const auto& read) {
    try {
      read();
    } catch (const InputError&) {
    } catch (const RunError&) {
    }
  };
  attempt([&] { (void)recording::read_checkpoint(recording::Hdf5File::open(path)); });
  attempt([&] { (void)recording::read_result(path); });
  attempt([&] { (void)recording::read_columns(path, {}); });
  attempt([&] { (void)dem::load_bed(path); });
  const recording::Hdf5File file = recording::Hdf5File::open(path);
  const recording::FrameReader frames(file);
  if (!frames.times().empty()) (void)frames.read(0);
}
