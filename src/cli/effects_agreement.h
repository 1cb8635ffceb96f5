// Every effect by both methods: what it changes in the steady means and in the means of a node-spring run.
#pragma once

#include <string>
#include <vector>

#include "effects/effect.h"

namespace terrode::cli {

struct Agreement {
  std::string id;
  effects::Reading steady, node_spring;  // with the effect at its typical strength less without it [N, N m, m, N]
  effects::Reading ripple;               // deviation of that difference over the window averaged
  // The largest difference between the two over the channels, each taken relative to its own change (of its mean or its
  // ripple, whichever is larger), or to a fifth of the largest change (relative to W, W r and the sinkage) where it hardly
  // changes.
  double gap = 0.0;
  std::string error;  // why there are no numbers; empty otherwise
};

// The wheel of the catalogue on its soil (slip 0.3, 115 N, first pass; multi_pass on the second), run 240 mm over nodes
// 10 mm apart, averaged over the middle third. In the order of the list.
std::vector<Agreement> effects_agreement(int threads);

// Where an effect parts for a reason (Info::parts_in_time): the same measured with the reason taken away.
struct ReasonAway {
  std::string id;
  std::string how;    // what was done about the reason
  double gap = 0.0;   // as above
  std::string error;
};
std::vector<ReasonAway> effects_without_reason(int threads);

// Share of the change by which the methods may part.
inline constexpr double kAgreement = 0.05;

// docs/effects-agreement.md.
std::string agreement_markdown(const std::vector<Agreement>& rows, const std::vector<ReasonAway>& without);

}  // namespace terrode::cli
