// Two campaigns on one soil: what a second bed or wheel does that the first, which is known, does not.
#pragma once

#include "diagnosis/campaign.h"
#include "diagnosis/model.h"
#include "diagnosis/ripple.h"

namespace terrode::diagnosis {

// The plain model with its parameters free, from several starts where the belief is a guess or far off; on the way the noise of
// `model` is estimated around it. Throws RunError where the plain model has no solution near the believed soil.
Fit fit_plain(Model& model, int threads);

struct Relative {
  Campaign campaign;
  Campaign reference;      // without runs where there is none
  double run_in = 0.0;     // m of rim path, of the reference
};

// `campaign` as it is beside `reference`, a campaign on the same soil whose bed, wheel and rig are known. What the plain model, refitted
// to the reference, leaves of a run's settled means there is taken off the run that repeats it here (runs of a condition in their
// order, one for one, so that their scatters add; further runs lose the mean of what is left at their condition). The belief is the
// reference's refitted soil, known but for its preparation, and its soil tests, as that soil has them, stand for this recording's. Whatever the plain model lacks on
// both thereby drops out, to first order.
// Runs whose condition the reference does not have, and channels that it lacks, are left out, with a remark.
// Throws InputError where no condition is shared.
Relative relative_to(Campaign campaign, const Campaign& reference, int threads);

// True where the reference shows a line too: at least a quarter of its amplitude by the same law, significant there or not.
bool shown_by_reference(const RippleLine& line, const Relative& relative);

}  // namespace terrode::diagnosis
