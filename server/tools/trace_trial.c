#include "trace_trial.h"

#include <inttypes.h>
#include <jansson.h>
#include <stdio.h>

static json_t *side_object(const struct trial_side *side) {
    return json_pack("{s:I, s:f, s:f, s:f}", "steps", (json_int_t)side->steps, "offset_mean_mm",
                     side->offset_mm, "noticeable_share", side->noticed, "penetration_max_mm",
                     side->penetration_mm);
}

static json_t *figures_object(const struct tissue_figures *f) {
    return json_pack("{s:i, s:f, s:f, s:f, s:f, s:f, s:f}", "cuts", (int)f->cuts, "removed_mm3",
                     f->removed_mm3, "pieces_mm3", f->pieces_mm3, "over_mm3", f->quality.over_mm3,
                     "under_mm3", f->quality.under_mm3, "rim_mm", f->quality.rim_mm, "left_mm3",
                     f->left_mm3);
}

static const char *instrument_name(int instrument) {
    return channel_name((enum channel)(CHANNEL_FIRST_INSTRUMENT + instrument));
}

static bool was_cut(const struct trial_report *r, int tissue) {
    return r->recorded[tissue].mesh_number || r->tried[tissue].mesh_number;
}

void trial_print_json(const struct trial_report *r, double real_time) {
    json_t *instruments = json_object(), *tissues = json_array(), *events = json_object();
    for (int i = 0; i < INSTRUMENT_COUNT; i++) {
        const struct trial_instrument *o = &r->instruments[i];
        if (o->recorded.steps || o->tried.steps)
            json_object_set_new(instruments, instrument_name(i),
                                json_pack("{s:I, s:f, s:f, s:o, s:o}", "steps", (json_int_t)o->both,
                                          "mean_mm", o->mean_mm, "max_mm", o->most_mm, "recorded",
                                          side_object(&o->recorded), "tried",
                                          side_object(&o->tried)));
    }
    for (int i = 0; i < TISSUES_MAX; i++)
        if (was_cut(r, i))
            json_array_append_new(tissues, json_pack("{s:i, s:o, s:o}", "tissue", i, "recorded",
                                                     figures_object(&r->recorded[i]), "tried",
                                                     figures_object(&r->tried[i])));
    for (int i = 0; i < EVENT_COUNT; i++)
        json_object_set_new(
            events, event_name(i),
            json_pack("[I, I]", (json_int_t)r->events_recorded[i], (json_int_t)r->events_tried[i]));
    json_t *root = json_pack("{s:I, s:I, s:o, s:o, s:o, s:f, s:s}", "steps", (json_int_t)r->steps,
                             "left_out", (json_int_t)r->left_out, "instruments", instruments,
                             "events", events, "resections", tissues, "times_real_time", real_time,
                             "end", r->end == RESULT_CLOSED ? "" : r->why.text);
    json_dumpf(root, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(12));
    putchar('\n');
    json_decref(root);
}

static void print_trial_instrument(int instrument, const struct trial_instrument *o) {
    const struct trial_side *a = &o->recorded, *b = &o->tried;
    printf("%s: shown %.3f mm elsewhere in the mean, at most %.3f mm, over %" PRIu64 " steps\n",
           instrument_name(instrument), o->mean_mm, o->most_mm, o->both);
    printf(
        "  recorded, tried: offset %.3f, %.3f mm in the mean; might be noticed in %.1f, %.1f %%; "
        "penetration up to %.2f, %.2f mm\n",
        a->offset_mm, b->offset_mm, 100 * a->noticed, 100 * b->noticed, a->penetration_mm,
        b->penetration_mm);
}

static void print_tissue(int tissue, const struct tissue_figures *a,
                         const struct tissue_figures *b) {
    printf(
        "tissue %d, recorded, tried: cuts %u, %u; removed %.1f, %.1f mm3; pieces %.1f, %.1f mm3; "
        "over the plan %.1f, %.1f mm3; short of it %.1f, %.1f mm3; rim %.2f, %.2f mm\n",
        tissue, a->cuts, b->cuts, a->removed_mm3, b->removed_mm3, a->pieces_mm3, b->pieces_mm3,
        a->quality.over_mm3, b->quality.over_mm3, a->quality.under_mm3, b->quality.under_mm3,
        a->quality.rim_mm, b->quality.rim_mm);
}

void trial_print_text(const struct trial_report *r, double real_time) {
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        if (r->instruments[i].recorded.steps || r->instruments[i].tried.steps)
            print_trial_instrument(i, &r->instruments[i]);
    for (int i = 0; i < EVENT_COUNT; i++)
        if (r->events_recorded[i] || r->events_tried[i])
            printf("%s: %" PRIu64 " times, now %" PRIu64 "\n", event_name(i), r->events_recorded[i],
                   r->events_tried[i]);
    for (int i = 0; i < TISSUES_MAX; i++)
        if (was_cut(r, i))
            print_tissue(i, &r->recorded[i], &r->tried[i]);
    if (r->left_out)
        printf("%" PRIu64 " steps after a gap could not be tried\n", r->left_out);
    if (r->end != RESULT_CLOSED)
        printf("not whole: %s\n", r->why.text);
    printf("%" PRIu64 " steps, %.0f times as fast as real time\n", r->steps, real_time);
}
