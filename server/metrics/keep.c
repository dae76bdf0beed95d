#include "metrics/metrics.h"

// What metrics use as an index. Their numbers may be any.
static bool smooth_is_sound(const struct smooth *s) {
    return s->count >= 0 && s->count <= SMOOTH_TAPS && s->next >= 0 && s->next < SMOOTH_TAPS;
}

static bool travel_is_sound(const struct travel *t) {
    return t->count >= 0 && t->count <= 3;
}

static bool gauge_is_sound(const struct gauge *g) {
    return (unsigned)g->validity < VALIDITY_COUNT;
}

static bool instrument_is_sound(const struct instrument_metrics *one, const struct standing *s) {
    return smooth_is_sound(&one->hand_smooth) && smooth_is_sound(&one->seen_smooth) &&
           travel_is_sound(&one->hand) && travel_is_sound(&one->seen) &&
           gauge_is_sound(&one->gauge) && s->nearest < CASE_GROUPS_MAX &&
           s->nearest >= (one->touch.touching ? 0 : -1);
}

// Optic and instruments are those of the session, whatever was kept.
void metrics_keep(struct metrics *metrics, struct kept *k) {
    struct view_optic optic = metrics->optic;
    struct instruments tools = metrics->tools;
    kept_bytes(k, metrics, sizeof *metrics);
    metrics->optic = optic;
    metrics->tools = tools;
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        kept_holds(k, instrument_is_sound(&metrics->instruments[i], &metrics->standing[i]));
    for (int i = 0; i < BODY_COUNT; i++)
        kept_holds(k, gauge_is_sound(&metrics->bones[i].gauge));
}
