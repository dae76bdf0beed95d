#include "device/stamp.h"

static const int64_t creep = 1000; // clocks may drift apart by 1 part in so many

static void start(struct stamp_clock *c, int64_t stamp_ns, int64_t arrival_ns) {
    *c = (struct stamp_clock){.known = true, .arrival_ns = arrival_ns, .good_ns = arrival_ns};
    c->offset_ns = c->told_ns = arrival_ns - stamp_ns;
}

enum stamp_verdict stamp_judge(struct stamp_clock *c, int64_t stamp_ns, int64_t arrival_ns) {
    if (!c->known) {
        start(c, stamp_ns, arrival_ns);
        return STAMP_GOOD;
    }
    int64_t crept = (arrival_ns - c->arrival_ns) / creep;
    c->offset_ns += crept;
    c->told_ns -= crept; // a clock that is a little fast is not told about
    if (c->told_ns < c->offset_ns)
        c->told_ns = c->offset_ns;
    c->arrival_ns = arrival_ns;
    c->lateness_ns = arrival_ns - stamp_ns - c->offset_ns;
    if (c->lateness_ns > STAMP_LATE_NS) {
        if (arrival_ns - c->good_ns < STAMP_MEMORY_NS)
            return STAMP_LATE;
        start(c, stamp_ns, arrival_ns);
        return STAMP_ANEW;
    }
    c->good_ns = arrival_ns;
    if (c->lateness_ns < 0)
        c->offset_ns += c->lateness_ns;
    if (c->told_ns - c->offset_ns < STAMP_LATE_NS)
        return STAMP_GOOD;
    c->lateness_ns = c->offset_ns - c->told_ns;
    c->told_ns = c->offset_ns;
    return STAMP_AHEAD;
}
