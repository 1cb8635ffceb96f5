// MATLAB files.
#include "harness.h"
#include "recording/mat_file.h"

FUZZ(mat) {
  using namespace terrode;
  const std::string path = fuzz::as_file("fuzz.mat", data, size);
  try {
    (void)recording::read_mat_columns(path, "");
  } catch (const InputError&) {
  }
  (void)recording::read_mat_columns(path, "run.data");
}
