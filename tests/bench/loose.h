// Steps with loose bodies, for the bench "tasks".
#pragma once

#include "bench.h"

// Eight of them between condyles and plateaus that come together, against the same knee without.
enum result loose_measure(struct report *report, struct error *err);
