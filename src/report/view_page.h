// A page that plays the frames of a run: ground with ruts, particles, wheels, forces, and the channels below. One file,
// no network; heights and places are kept in 16 bits, as differences from frame to frame, compressed.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

#include "core/progress.h"
#include "recording/frames.h"
#include "recording/recording.h"

namespace terrode::report {

struct ViewOptions {
  std::string title;
  std::size_t largest = 48'000'000;    // bytes of the page; above it every second frame is left out, and so on
  std::size_t ground_nodes = 250'000;  // more nodes than that are thinned out
};

struct ViewPage {
  std::string html;
  std::size_t frames = 0;              // shown
  std::size_t every = 1;               // 2: every second frame of the file, ...
  double height_step = 0.0;            // m, resolution of the ground's heights
  double position_step = 0.0;          // m, coarsest resolution of the particles' places
};

// `series` gives the channels under the picture (may be empty). Throws InputError when there are no frames.
ViewPage view_page(const recording::FrameReader& frames, const recording::Run& series, const ViewOptions& options,
                   const Progress& progress = {});

}  // namespace terrode::report
