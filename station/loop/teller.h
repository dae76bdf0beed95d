// What a person at the station sees each second: a line of figures on stdout, and in the log what
// became of devices and markers. A thread of its own writes, so that a slow terminal or disk holds
// up no pose.
#pragma once

#include "link/link.h"
#include "samples/runner.h"

struct teller;

// One second of the loop's.
struct told_second {
    uint64_t warped, unanswered, markers_lost; // the last two since the start
    double p50_us, p99_us, warp_mm, alignment_ms;
    struct sample pressed; // the largest force; its time is 0: none
};

// live: the line of figures too. Both must outlive the teller.
struct teller *teller_create(struct runner *runner, struct link *link, bool live);

// Copies, and waits for nothing. Seconds for which the writer has no time are left out.
void teller_tell(struct teller *teller, const struct told_second *second);

// Waits for what is being written. NULL inside is fine.
void teller_destroy(struct teller **teller);
