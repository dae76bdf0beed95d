#include "drivers/stamp.h"

#include "base/clock.h"

#include <math.h>

#define SET_BACK_NS (20 * NS_PER_MS) // tools' stamps may cross by less

static const int64_t clock_creep = 1000; // clocks may drift apart by 1 part in so many

static void start(struct stamp_clock *c, int64_t stamp_ns, int64_t arrival_ns) {
    *c = (struct stamp_clock){.known = true, .arrival_ns = arrival_ns, .good_ns = arrival_ns};
    c->offset_ns = c->told_ns = arrival_ns - stamp_ns;
}

enum stamp_verdict stamp_judge(struct stamp_clock *c, int64_t stamp_ns, int64_t arrival_ns) {
    if (!c->known) {
        start(c, stamp_ns, arrival_ns);
        return STAMP_GOOD;
    }
    int64_t crept = (arrival_ns - c->arrival_ns) / clock_creep;
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
    c->fit = (struct stamp_fit){0};
    return STAMP_AHEAD;
}

static const int64_t trial_ns = 3 * NS_PER_S;
static const int trial_messages = 10;

// What is really late left a gap before it came; a clock that was set is late for half the time.
bool stamp_is_no_clock(struct stamp_trial *t, enum stamp_verdict verdict, int64_t arrival_ns) {
    if (!t->count)
        *t = (struct stamp_trial){.begin_ns = arrival_ns, .arrival_ns = arrival_ns};
    int64_t gap_ns = arrival_ns - t->arrival_ns, passed_ns = arrival_ns - t->begin_ns;
    t->gap_ns = gap_ns > t->gap_ns ? gap_ns : t->gap_ns;
    t->arrival_ns = arrival_ns;
    t->count++;
    t->bad += verdict != STAMP_GOOD;
    if (passed_ns < trial_ns)
        return false;
    int64_t longest_ns = 3 * passed_ns / t->count;
    bool regular = t->gap_ns < (longest_ns > STAMP_LATE_NS ? longest_ns : STAMP_LATE_NS);
    bool found = regular && t->count >= trial_messages && 3 * t->bad > 2 * t->count;
    *t = (struct stamp_trial){0};
    return found;
}

// ---- the time of a measurement ------------------------------------------------------------------

static const struct stamp_way *way(const struct stamp_fit *f, int i) { // 0: the oldest
    return &f->ways[(f->next - f->count + i + STAMP_FIT_SECONDS) % STAMP_FIT_SECONDS];
}

static double slope_between(const struct stamp_way *a, const struct stamp_way *b) {
    return (double)(b->offset_ns - a->offset_ns) / (double)(b->stamp_ns - a->stamp_ns);
}

// The lower hull, and of it the edge over the middle.
static void fit_line(struct stamp_fit *f) {
    const struct stamp_way *hull[STAMP_FIT_SECONDS];
    int count = 0, edge = 0;
    for (int i = 0; i < f->count; i++) {
        while (count > 1 && slope_between(hull[count - 2], hull[count - 1]) >=
                                slope_between(hull[count - 1], way(f, i)))
            count--;
        hull[count++] = way(f, i);
    }
    int64_t middle_ns =
        way(f, 0)->stamp_ns + (way(f, f->count - 1)->stamp_ns - way(f, 0)->stamp_ns) / 2;
    while (edge + 2 < count && hull[edge + 1]->stamp_ns < middle_ns)
        edge++;
    f->line = *hull[edge];
    double slope = count > 1 ? slope_between(hull[edge], hull[edge + 1]) : 0;
    f->slope = fmax(-1.0 / (double)clock_creep, fmin(1.0 / (double)clock_creep, slope));
}

static void take_way(struct stamp_fit *f, struct stamp_way new) {
    bool first = !f->second_end_ns, ends = !first && new.stamp_ns >= f->second_end_ns;
    if (ends) {
        f->ways[f->next] = f->least;
        f->next = (f->next + 1) % STAMP_FIT_SECONDS;
        f->count += f->count < STAMP_FIT_SECONDS;
        fit_line(f);
    }
    if (first || ends)
        f->second_end_ns = new.stamp_ns + NS_PER_S;
    if (first || ends || new.offset_ns < f->least.offset_ns)
        f->least = new;
    if (first || (f->count < 2 && new.offset_ns < f->line.offset_ns))
        f->line = new;
}

int64_t stamp_time(struct stamp_clock *c, int64_t stamp_ns, int64_t arrival_ns) {
    struct stamp_fit *f = &c->fit;
    if (stamp_ns < c->told_stamp_ns - SET_BACK_NS)
        *f = (struct stamp_fit){0};
    take_way(f, (struct stamp_way){stamp_ns, arrival_ns - stamp_ns});
    double since = (double)(stamp_ns - f->line.stamp_ns);
    int64_t time_ns = stamp_ns + f->line.offset_ns + (int64_t)(f->slope * since);
    int64_t passed_ns = (stamp_ns - c->told_stamp_ns) / 2; // time goes on while a fit is mended
    if (c->told_time_ns && passed_ns > 0 && time_ns < c->told_time_ns + passed_ns)
        time_ns = c->told_time_ns + passed_ns;
    if (time_ns > arrival_ns)
        time_ns = arrival_ns;
    c->told_stamp_ns = stamp_ns;
    c->told_time_ns = time_ns;
    return time_ns;
}
