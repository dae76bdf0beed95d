#include "bench.h"
#include "folder.h"
#include "metrics_play.h"
#include "scene/played.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char *const worse_names[WORSE_COUNT] = {
    [AS_IT_IS] = "", [WORSE_NOISE] = "noise", [WORSE_RATE] = "rate", [WORSE_DROPPED] = "dropped"};

static const char *const recordings[] = {
    "em_watertank_probe",
    "em_watertank_probe_raw_timestamps",
    "em_watertank_reference",
    "em_watertank_stylus_static",
    "mocap100_handheld_fr1xyz",
    "nwire_probe",
    "optical50_probe",
    "stylus_landmarks",
    "stylus_landmarks_reference",
};

// The largest change of each metric.
struct changes {
    bool seen[METRIC_COUNT];
    double largest[METRIC_COUNT];
};

struct measuring {
    struct report *report;
    int seeds;
    struct changes above, below, counted; // continuous, over their floor and under it; the others
    double ldlj_largest;                  // of the logarithm itself
    struct figures base, worse;
};

static bool is_same(const struct metric_value *a, const struct metric_value *b) {
    return a->metric == b->metric && a->instrument == b->instrument && a->group == b->group &&
           a->depth == b->depth && a->tissue == b->tissue && a->along == b->along &&
           a->across == b->across;
}

static const struct metric_value *find(const struct figures *figures,
                                       const struct metric_value *like) {
    for (int i = 0; i < figures->count; i++)
        if (is_same(&figures->values[i], like))
            return &figures->values[i];
    return NULL;
}

static bool is_ldlj(enum metric metric) {
    return metric == METRIC_LDLJ_HAND || metric == METRIC_LDLJ_SEEN;
}

// A logarithm changes little whatever happens: what counts is the change of the jerk in it.
static double change_of(enum metric metric, double base, double now) {
    if (is_ldlj(metric))
        return fabs(exp(0.5 * (base - now)) - 1);
    return fabs(now - base) / fabs(base);
}

static void note(struct changes *changes, enum metric metric, double change) {
    changes->seen[metric] = true;
    changes->largest[metric] = fmax(changes->largest[metric], change);
}

static void compare(struct measuring *m, struct changes *here) {
    for (int i = 0; i < m->base.count; i++) {
        const struct metric_value *base = &m->base.values[i];
        const struct metric_value *now = find(&m->worse, base);
        enum metric metric = base->metric;
        if (isnan(base->value) || base->value == 0 || !now || isnan(now->value))
            continue;
        double change = change_of(metric, base->value, now->value);
        bool above = !base->below_floor && !now->below_floor;
        if (!metric_kinds[metric].continuous) {
            note(&m->counted, metric, change);
        } else if (above) {
            note(&m->above, metric, change);
            note(here, metric, change);
            if (is_ldlj(metric))
                m->ldlj_largest =
                    fmax(m->ldlj_largest, fabs((now->value - base->value) / base->value));
        } else {
            note(&m->below, metric, change);
        }
    }
}

static void report_changes(struct report *report, const char *prefix,
                           const struct changes *changes) {
    for (int i = 0; i < METRIC_COUNT; i++)
        if (changes->seen[i])
            report_figure(report, changes->largest[i], "1", "%s/%s", prefix, metric_kinds[i].name);
}

static void report_base(struct measuring *m, const char *name) {
    for (int i = 0; i < m->base.count; i++) {
        const struct metric_value *v = &m->base.values[i];
        const struct metric_kind *kind = &metric_kinds[v->metric];
        if (kind->continuous && v->instrument <= 0 && !v->below_floor)
            report_figure(m->report, v->value, kind->unit, "%s/%s", name, kind->name);
    }
}

static void measure(struct measuring *m, const struct hands_at_work *hands) {
    hands_play(hands, AS_IT_IS, 0, &m->base);
    report_base(m, hands->name);
    report_figure(m->report, m->base.step_ns, "ns", "%s/step", hands->name);
    for (enum worse worse = AS_IT_IS + 1; worse < WORSE_COUNT; worse++) {
        struct changes here = {0};
        char prefix[96];
        for (int seed = 0; seed < m->seeds; seed++) {
            hands_play(hands, worse, (uint64_t)seed, &m->worse);
            compare(m, &here);
        }
        snprintf(prefix, sizeof prefix, "%s/%s", hands->name, worse_names[worse]);
        report_changes(m->report, prefix, &here);
    }
}

// ---- whose hands --------------------------------------------------------------------------------

static enum result measure_recordings(struct measuring *m, struct error *err) {
    for (size_t i = 0; i < sizeof recordings / sizeof *recordings; i++) {
        struct hands_at_work hands;
        enum result result = hands_recorded(recordings[i], &hands, err);
        if (result == RESULT_OK)
            measure(m, &hands);
        else if (result == RESULT_MISSING)
            report_text(m->report, recordings[i], "skipped: no such recording here");
        else
            return result;
        hands_at_work_fini(&hands);
    }
    return RESULT_OK;
}

// A scope goes in before all else, and looks on.
static enum result plan_with_scope(struct knee_case *knee, double tremor_mm, struct motion *out,
                                   struct error *err) {
    struct motion_script script;
    enum result result = motion_script_load(CASES "/motions/palpation.ini", &script, err);
    if (result != RESULT_OK)
        return result;
    script.tremor_mm = tremor_mm;
    memmove(script.steps + 1, script.steps, (size_t)script.step_count++ * sizeof *script.steps);
    script.steps[0] = (struct motion_step){
        .verb = MOTION_APPROACH, .tool = CHANNEL_SCOPE, .name = "anterolateral"};
    return motion_plan(knee, &script, out, err);
}

static enum result measure_motions(struct measuring *m, const char *dir, struct error *err) {
    struct played played;
    enum result result = played_init(CASES, "everything", dir, &played, err);
    for (int i = 0; result == RESULT_OK && i < 2; i++) {
        struct motion motion = {0};
        struct knee_case *knee;
        struct hands_at_work hands = {0};
        result = case_load(dir, NULL, &knee, err);
        if (result != RESULT_OK)
            break;
        result = plan_with_scope(knee, i ? 0.1 : 0, &motion, err);
        if (result == RESULT_OK) {
            hands_of_motion(&motion, played.scene, i ? "palpation_tremor" : "palpation", &hands);
            measure(m, &hands);
        }
        hands_at_work_fini(&hands);
        motion_fini(&motion);
        case_destroy(&knee);
    }
    if (played.scene)
        played_fini(&played);
    return result;
}

static enum result measure_all(struct measuring *m, struct error *err) {
    char folder[FOLDER_MAX];
    folder_make(folder);
    enum result result = measure_motions(m, folder, err);
    folder_remove(folder);
    return result == RESULT_OK ? measure_recordings(m, err) : result;
}

enum result bench_metrics(const struct bench_options *options, struct report *report,
                          struct error *err) {
    struct measuring *m = calloc(1, sizeof *m);
    m->report = report;
    m->seeds = options->quick ? 2 : 8;
    enum result result = measure_all(m, err);
    if (result == RESULT_OK) {
        double largest = 0;
        for (int i = 0; i < METRIC_COUNT; i++)
            largest = fmax(largest, m->above.largest[i]);
        report_figure(report, sizeof(struct metrics), "bytes", "memory");
        report_changes(report, "change", &m->above);
        report_changes(report, "change_below_floor", &m->below);
        report_changes(report, "change_of_others", &m->counted);
        report_figure(report, m->ldlj_largest, "1", "change_of_ldlj_as_number");
        report_mark(report, "metric_noise_change", largest, "1", 0.1, BETTER_LOW);
    }
    free(m);
    return result;
}
