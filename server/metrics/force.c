#include "metrics/force.h"

#include <math.h>

void gauge_step(struct gauge *g, const struct sample *told, int64_t time_ns) {
    if (told) {
        *g = (struct gauge){true, told->validity, told->force_n, time_ns};
        return;
    }
    if (g->validity == VALIDITY_OK)
        g->validity = VALIDITY_HELD;
    if (time_ns - g->told_ns > FORCE_HOLD_NS)
        g->validity = VALIDITY_LOST;
}

void force_pass(struct force_figures *f, const struct gauge *g, int64_t passed_ns) {
    if (!g->known)
        return;
    f->in_ns[g->validity] += passed_ns;
    if (g->validity != VALIDITY_OK)
        return;
    double force_n = fabs(g->force_n);
    f->sum_n_ns += force_n * (double)passed_ns;
    f->peak_n = fmax(f->peak_n, force_n);
}

int64_t force_time_ns(const struct force_figures *f) {
    int64_t all_ns = 0;
    for (int i = 0; i < VALIDITY_COUNT; i++)
        all_ns += f->in_ns[i];
    return all_ns;
}

double force_mean_n(const struct force_figures *f) {
    int64_t measured_ns = f->in_ns[VALIDITY_OK];
    return measured_ns ? f->sum_n_ns / (double)measured_ns : NAN;
}

double force_peak_n(const struct force_figures *f) {
    return f->in_ns[VALIDITY_OK] ? f->peak_n : NAN;
}
