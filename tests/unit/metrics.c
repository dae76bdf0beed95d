// The figures of a session, from steps made by hand: each against what these steps mean.

#include "base/clock.h"
#include "metrics/subject.h"
#include "random.h"
#include "test.h"

#include <stdio.h>
#include <string.h>

#define MS NS_PER_MS
#define PROBE 0
#define SHAVER (CHANNEL_SHAVER - CHANNEL_FIRST_INSTRUMENT)
#define KNIFE (CHANNEL_KNIFE - CHANNEL_FIRST_INSTRUMENT)
#define SCOPE (CHANNEL_SCOPE - CHANNEL_FIRST_INSTRUMENT)

static const struct view_optic optic = {30, 90};

// A step that runs at a time, with a frame that has no samples.
struct moment {
    struct session_input input;
    struct session_output output;
};

static void moment_init(struct moment *m, int64_t time_ns) {
    memset(m, 0, sizeof *m);
    m->input.kind = INPUT_FRAME;
    m->input.time_ns = m->output.time_ns = time_ns;
    m->output.state = SESSION_RUNNING;
}

// A fresh sample of an instrument, shown somewhere.
static struct instrument_output *put(struct moment *m, int instrument, vec3 hand, vec3 seen) {
    struct instrument_output *o = &m->output.instruments[instrument];
    *o = (struct instrument_output){.present = true,
                                    .T_mockup_tip = {quat_identity(), hand},
                                    .T_mockup_warped = {quat_identity(), seen},
                                    .warp = {.nearest = -1, .nearest_mm = INFINITY},
                                    .discrepancy = {.gain = 1, .gain_least = 1}};
    struct frame *frame = &m->input.frame;
    frame->samples[frame->count++] =
        (struct sample){.channel = (enum channel)(CHANNEL_FIRST_INSTRUMENT + instrument),
                        .kind = SAMPLE_POSE,
                        .time_ns = m->output.time_ns,
                        .T_mockup_body = o->T_mockup_tip};
    return o;
}

static void take(struct metrics *m, const struct moment *moment) {
    metrics_step(m, &moment->input, &moment->output);
}

struct wanted {
    struct metric_value like, found;
    int count;
};

static void look(void *context, const struct metric_value *v) {
    struct wanted *w = context;
    const struct metric_value *l = &w->like;
    if (v->metric != l->metric || v->instrument != l->instrument || v->group != l->group ||
        v->depth != l->depth || v->tissue != l->tissue || v->along != l->along ||
        v->across != l->across)
        return;
    w->found = *v;
    w->count++;
}

static struct metric_value about(enum metric metric, int instrument) {
    return (struct metric_value){metric, instrument, -1, -1, -1, -1, -1, NULL, 0, false};
}

static double figure(const struct metrics *m, struct metric_value like) {
    struct wanted w = {.like = like};
    metrics_each(m, NULL, look, &w);
    assert_int_equal(w.count, 1);
    return w.found.value;
}

static bool is_below_floor(const struct metrics *m, enum metric metric, int instrument) {
    struct wanted w = {.like = about(metric, instrument)};
    metrics_each(m, NULL, look, &w);
    assert_int_equal(w.count, 1);
    return w.found.below_floor;
}

static double group_figure(const struct metrics *m, enum metric metric, int group, int depth) {
    struct metric_value like = about(metric, PROBE);
    like.group = group;
    like.depth = depth;
    return figure(m, like);
}

// ---- time ---------------------------------------------------------------------------------------

static void time_runs_while_the_session_does(void **state) {
    (void)state;
    static struct metrics m;
    static struct moment at;
    metrics_init(&m, instruments_usual(), optic);
    const struct {
        int64_t ms;
        enum session_state state;
    } rows[] = {{100, SESSION_WAITING}, {400, SESSION_RUNNING},  {700, SESSION_RUNNING},
                {900, SESSION_PAUSED},  {1900, SESSION_RUNNING}, {2000, SESSION_CLOSED},
                {9000, SESSION_CLOSED}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        moment_init(&at, rows[i].ms * MS);
        at.output.state = rows[i].state;
        take(&m, &at);
    }
    assert_near(figure(&m, about(METRIC_TIME, -1)), 0.6, 1e-9);
}

static void a_reset_begins_anew(void **state) {
    (void)state;
    static struct metrics m, untouched;
    static struct moment at;
    metrics_init(&m, instruments_usual(), optic);
    metrics_init(&untouched, instruments_usual(), optic);
    for (int i = 0; i < 100; i++) {
        moment_init(&at, i * 10 * MS);
        put(&at, PROBE, (vec3){i, 0, 0}, (vec3){i, 0, 0})->warp =
            (struct warp){.nearest = 1, .nearest_mm = 0};
        at.output.landed = (struct landed){.job = 1, .tissue = 2, .figures = {.cuts = 3}};
        take(&m, &at);
    }
    moment_init(&at, 1000 * MS);
    at.input.kind = INPUT_RESET;
    take(&m, &at);
    take(&untouched, &at);
    assert_memory_equal(&m, &untouched, sizeof m);
    put(&at, PROBE, (vec3){0}, (vec3){0});
    at.output.state = SESSION_CLOSED; // which takes no reset
    take(&m, &at);
    moment_init(&at, 2000 * MS);
    at.input.kind = INPUT_RESET;
    at.output.state = SESSION_CLOSED;
    take(&m, &at);
    assert_near(figure(&m, about(METRIC_TIME, -1)), 0, 1e-9);
}

// ---- shares of time -----------------------------------------------------------------------------

static void values_count_until_the_next_step_at_any_rate(void **state) {
    (void)state;
    for (int period_ms = 1; period_ms <= 50; period_ms *= 5) {
        static struct metrics m;
        static struct moment at;
        metrics_init(&m, instruments_usual(), optic);
        for (int ms = 0; ms <= 10000; ms += period_ms) {
            moment_init(&at, ms * MS);
            struct instrument_output *o = put(&at, PROBE, (vec3){0, 0, 20}, (vec3){0, 0, 20});
            o->discrepancy.turn_deg = ms < 2000 ? 4.6 : 4.4;
            o->discrepancy.tilt_deg = ms < 3000 ? 4.6 : 4.4;
            o->discrepancy.gain = ms >= 9000 ? 1.08 : 1;
            o->discrepancy.gain_least = ms >= 8000 ? 0.87 : 1;
            o->warp = (struct warp){.nearest = ms < 5000 ? 4 : 6, .nearest_mm = ms < 6000 ? 0 : 1};
            o->penetration_mm = ms < 1000 ? 0.6 : 0.2;
            if (ms >= 4000)
                put(&at, SCOPE, (vec3){0}, (vec3){0, 0, ms < 7000 ? 0 : 40});
            take(&m, &at);
        }
        const double late = METRICS_NOTICE_NS / 10e9; // a change is noticed within that time
        assert_near(figure(&m, about(METRIC_PRESENT, PROBE)), 10, 1e-9);
        assert_near(figure(&m, about(METRIC_NOTICED_TURN, PROBE)), 0.2, late);
        assert_near(figure(&m, about(METRIC_NOTICED_TILT, PROBE)), 0.3, late);
        assert_near(figure(&m, about(METRIC_NOTICED_GAIN, PROBE)), 0.2, late);
        assert_near(figure(&m, about(METRIC_NOTICED_ANY, PROBE)), 0.5, late);
        assert_near(group_figure(&m, METRIC_CONTACT_TIME, 4, -1), 5, 1e-9);
        assert_near(group_figure(&m, METRIC_CONTACT_TIME, 6, -1), 1, 1e-9);
        assert_near(group_figure(&m, METRIC_DEPTH_TIME, 4, 1), 1, 1e-9);
        assert_near(group_figure(&m, METRIC_DEPTH_TIME, 4, 0), 4, 1e-9);
        assert_near(group_figure(&m, METRIC_DEPTH_MAX, 4, -1), 0.6, 0);
        assert_near(figure(&m, about(METRIC_OUT_OF_VIEW, PROBE)), 3, 1e-9);
        assert_near(figure(&m, about(METRIC_OUT_OF_VIEW_SHARE, PROBE)), 0.5, 1e-9);
        assert_near(figure(&m, about(METRIC_TRIANGULATION_FIRST, PROBE)), 0, 1e-9);
    }
}

static void trembling_at_a_threshold_counts_by_where_it_mostly_is(void **state) {
    (void)state;
    for (int past = 0; past <= 10; past++) {
        static struct metrics m;
        static struct moment at;
        metrics_init(&m, instruments_usual(), optic);
        for (int i = 0; i < 2000; i++) {
            moment_init(&at, i * 5 * MS);
            struct instrument_output *o = put(&at, PROBE, (vec3){0}, (vec3){0});
            o->discrepancy.turn_deg = i * 7 % 10 < past ? 180 : 0;
            take(&m, &at);
        }
        double share = figure(&m, about(METRIC_NOTICED_TURN, PROBE));
        if (past < 5)
            assert_near(share, 0, 1e-9);
        if (past > 5)
            assert_true(share > 0.9);
    }
}

static void an_old_trace_tells_nothing_of_the_warp(void **state) {
    (void)state;
    static struct metrics m;
    static struct moment at;
    metrics_init(&m, instruments_usual(), optic);
    for (int i = 0; i < 10; i++) {
        moment_init(&at, i * 10 * MS);
        put(&at, PROBE, (vec3){0}, (vec3){0})->discrepancy = (struct discrepancy){0};
        take(&m, &at);
    }
    assert_true(isnan(figure(&m, about(METRIC_NOTICED_GAIN, PROBE))));
    assert_true(isnan(figure(&m, about(METRIC_NOTICED_ANY, PROBE))));
}

static void a_hole_in_the_steps_counts_for_little(void **state) {
    (void)state;
    static struct metrics m;
    static struct moment at;
    metrics_init(&m, instruments_usual(), optic);
    for (int i = 0; i < 2; i++) {
        moment_init(&at, i * 5000 * MS);
        put(&at, PROBE, (vec3){0}, (vec3){0});
        take(&m, &at);
    }
    assert_near(figure(&m, about(METRIC_TIME, -1)), 5, 1e-9);
    assert_near(figure(&m, about(METRIC_PRESENT, PROBE)), 0.1, 1e-9);
}

static void without_another_nothing_is_said_of_the_view(void **state) {
    (void)state;
    for (int instrument = 0; instrument < INSTRUMENTS_USUAL; instrument++) {
        static struct metrics m;
        static struct moment at;
        metrics_init(&m, instruments_usual(), optic);
        for (int i = 0; i < 10; i++) {
            moment_init(&at, i * 10 * MS);
            put(&at, instrument, (vec3){0}, (vec3){0});
            take(&m, &at);
        }
        struct wanted w = {.like = about(METRIC_OUT_OF_VIEW, instrument)};
        metrics_each(&m, NULL, look, &w);
        assert_int_equal(w.count, 0);
    }
}

// ---- motion -------------------------------------------------------------------------------------

// 40 mm/s for 10 s, shown at half the speed. Steps come late and repeat what they have.
static void walk(struct metrics *m, int paused_from_ms, int paused_to_ms) {
    static struct moment at;
    struct random r = {9};
    metrics_init(m, instruments_usual(), optic);
    int64_t late_ns = 0;
    for (int i = 0; i <= 500; i++) {
        int64_t measured_ns = i * 20 * MS;
        int64_t step_ns = measured_ns + late_ns;
        vec3 hand = {40e-9 * (double)measured_ns, 0, 0}, seen = vec3_scale(0.5, hand);
        moment_init(&at, step_ns);
        struct instrument_output *o = put(&at, PROBE, hand, seen);
        at.input.frame.samples[0].time_ns = measured_ns;
        if (i * 20 >= paused_from_ms && i * 20 < paused_to_ms) {
            at.output.state = SESSION_PAUSED;
            memset(o, 0, sizeof *o);
        }
        take(m, &at);
        at.output.time_ns += 5 * MS; // an empty step: the same pose again
        at.input.kind = INPUT_EMPTY;
        take(m, &at);
        late_ns = (int64_t)random_between(&r, 0, 14e6);
    }
}

static void motion_is_timed_by_its_samples_and_not_by_steps(void **state) {
    (void)state;
    static struct metrics m;
    walk(&m, 0, 0);
    assert_near(figure(&m, about(METRIC_PATH_HAND, PROBE)), 400 - 0.43 * 40, 1);
    assert_near(figure(&m, about(METRIC_PATH_SEEN, PROBE)), 200 - 0.43 * 20, 1);
    assert_near(figure(&m, about(METRIC_ECONOMY_HAND, PROBE)), 1, 1e-6);
    assert_near(m.instruments[PROBE].hand.largest_speed, 40, 1e-6);
    assert_true(m.instruments[PROBE].hand.jerk_squared < 1e-6);
    assert_false(is_below_floor(&m, METRIC_PATH_HAND, PROBE));
}

static void a_pause_is_never_bridged(void **state) {
    (void)state;
    static struct metrics m;
    walk(&m, 4000, 4100);
    double lost_s = 2 * 0.43 + 0.12;
    assert_near(figure(&m, about(METRIC_PATH_HAND, PROBE)), 400 - 40 * lost_s, 2);
}

static void time_while_the_server_was_down_does_not_count(void **state) {
    (void)state;
    static struct metrics m;
    static struct moment at;
    metrics_init(&m, instruments_usual(), optic);
    for (int i = 0; i < 200; i++) {
        int64_t down_ns = i < 100 ? 0 : 120 * MS; // so little that it would be bridged
        if (i == 100)
            metrics_interrupt(&m);
        moment_init(&at, i * 10 * MS + down_ns);
        put(&at, PROBE, (vec3){i, 0, 0}, (vec3){i, 0, 0});
        put(&at, SCOPE, (vec3){0}, (vec3){i, 0, i < 40 || i >= 160 ? 200 : -10});
        take(&m, &at);
    }
    assert_near(figure(&m, about(METRIC_TIME, -1)), 2 * 0.99, 1e-9);
    assert_near(figure(&m, about(METRIC_PRESENT, PROBE)), 2 * 0.99, 1e-9);
    assert_near(figure(&m, about(METRIC_PATH_HAND, PROBE)), 2 * (99 - 43), 3);
    assert_near(figure(&m, about(METRIC_TRIANGULATION_FIRST, PROBE)), 0.4, 1e-9);
    assert_near(figure(&m, about(METRIC_TRIANGULATIONS, PROBE)), 2, 0);
    assert_near(figure(&m, about(METRIC_TRIANGULATION_MEAN, PROBE)), 0.2, 1e-9);
}

static void slow_and_short_motion_is_below_its_floor(void **state) {
    (void)state;
    static struct metrics m;
    static struct moment at;
    metrics_init(&m, instruments_usual(), optic);
    for (int i = 0; i < 1000; i++) {
        moment_init(&at, i * 10 * MS);
        put(&at, PROBE, (vec3){3e-3 * i, 0, 0}, (vec3){30e-3 * i, 0, 0});
        put(&at, SCOPE, (vec3){60e-3 * i, 0, 0}, (vec3){60e-3 * i, 0, 0});
        for (int k = SHAVER; k <= KNIFE; k++) { // 20 and 17 samples a second
            put(&at, k, (vec3){0, 60e-3 * i, 0}, (vec3){0, 60e-3 * i, 0});
            at.input.frame.count -= i % (k == SHAVER ? 5 : 6) != 0;
        }
        if (i % 100 < 40) // long lost, again and again
            at.output.instruments[SCOPE].present = false;
        take(&m, &at);
    }
    assert_true(is_below_floor(&m, METRIC_PATH_HAND, PROBE));
    assert_false(is_below_floor(&m, METRIC_PATH_SEEN, PROBE));
    assert_true(is_below_floor(&m, METRIC_ECONOMY_SEEN, PROBE));
    assert_true(is_below_floor(&m, METRIC_LDLJ_SEEN, PROBE));
    assert_true(is_below_floor(&m, METRIC_PATH_SEEN, SCOPE));
    assert_false(is_below_floor(&m, METRIC_PATH_SEEN, SHAVER));
    assert_true(is_below_floor(&m, METRIC_PATH_SEEN, KNIFE));
    assert_false(is_below_floor(&m, METRIC_PRESENT, KNIFE));
    assert_true(is_below_floor(&m, METRIC_BIMANUAL, -1));
}

static void jerk_counts_where_it_is_over_the_noise(void **state) {
    (void)state;
    for (int over = 0; over < 2; over++) {
        static struct metrics m;
        static struct moment at;
        metrics_init(&m, instruments_usual(), optic);
        // a (2πf)³ response / √2 of jerk: 2.3 noises where a is 1
        double a = (over ? 1.05 : 0.95) * 2.3 * 258 * sqrt(2) / pow(2 * M_PI, 3) / 0.947;
        for (int i = 0; i < 3000; i++) {
            double x = a * sin(2 * M_PI * 0.01 * i);
            moment_init(&at, i * 10 * MS);
            put(&at, PROBE, (vec3){x, 0, 0}, (vec3){3 * x, 0, 0});
            take(&m, &at);
        }
        assert_int_equal(is_below_floor(&m, METRIC_LDLJ_HAND, PROBE), !over);
        assert_false(is_below_floor(&m, METRIC_LDLJ_SEEN, PROBE));
    }
}

static void a_lost_or_foreign_sample_moves_nothing(void **state) {
    (void)state;
    static struct metrics m;
    static struct moment at;
    metrics_init(&m, instruments_usual(), optic);
    for (int i = 0; i < 300; i++) {
        moment_init(&at, i * 10 * MS);
        put(&at, PROBE, (vec3){i, 0, 0}, (vec3){i, 0, 0});
        struct sample *s = &at.input.frame.samples[0];
        if (i % 3 == 0)
            s->validity = VALIDITY_LOST;
        else if (i % 3 == 1)
            s->kind = SAMPLE_HANDLE;
        else
            s->channel = CHANNEL_TIBIA;
        take(&m, &at);
    }
    assert_near(figure(&m, about(METRIC_PATH_HAND, PROBE)), 0, 0);
}

static void two_hands_count_together(void **state) {
    (void)state;
    static struct metrics m;
    static struct moment at;
    metrics_init(&m, instruments_usual(), optic);
    for (int i = 0; i <= 1600; i++) {
        double t = 0.01 * i;
        moment_init(&at, i * 10 * MS);
        vec3 first = {20 * fmin(t, 10), 0, 0}, second = {0, 20 * fmax(t - 6, 0), 0};
        put(&at, PROBE, first, first);
        put(&at, SCOPE, second, second);
        take(&m, &at);
    }
    assert_near(figure(&m, about(METRIC_BIMANUAL, -1)), 4 / (16 - 0.42), 0.01);
}

// ---- tissue -------------------------------------------------------------------------------------

static void the_last_figures_of_each_tissue_stand(void **state) {
    (void)state;
    static struct metrics m;
    static struct moment at;
    metrics_init(&m, instruments_usual(), optic);
    for (int i = 1; i <= 3; i++) {
        struct tissue_figures f = {.cuts = (uint32_t)i, .refused = 1};
        f.quality =
            (struct quality_report){.removed_mm3 = 10 * i, .over_mm3 = i, .under_mm3 = 9 - i};
        f.quality.removed.mm3[ZONE_BODY][ZONE_OUTER] = 7 * i;
        moment_init(&at, i * 100 * MS);
        at.output.landed = (struct landed){.job = (uint64_t)i, .tissue = 1, .figures = f};
        take(&m, &at);
        moment_init(&at, i * 100 * MS + MS);
        take(&m, &at);
    }
    const struct {
        enum metric metric;
        double value;
    } rows[] = {{METRIC_CUTS, 3},
                {METRIC_CUTS_REFUSED, 1},
                {METRIC_REMOVED, 30},
                {METRIC_OVER, 3},
                {METRIC_UNDER, 6}};
    struct metric_value like = about(METRIC_CUTS, -1);
    like.tissue = 1;
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        like.metric = rows[i].metric;
        assert_true(figure(&m, like) == rows[i].value);
    }
    like.metric = METRIC_ZONE_REMOVED;
    like.along = ZONE_BODY;
    like.across = ZONE_OUTER;
    assert_true(figure(&m, like) == 21);
    like.tissue = 0;
    struct wanted w = {.like = like};
    metrics_each(&m, NULL, look, &w);
    assert_int_equal(w.count, 0);
}

static void of_a_tissue_without_zones_rim_and_zones_are_not_told(void **state) {
    (void)state;
    static struct metrics m;
    metrics_init(&m, instruments_usual(), optic);
    m.resected[0] = m.resected[1] = true;
    struct knee_case *knee = case_create("x", "");
    case_add_group(knee, "tibia", BODY_TIBIA);
    struct case_group *plica = case_add_group(knee, "plica", BODY_FEMUR);
    case_add_group(knee, "meniscus_medial", BODY_TIBIA)->cuttable = plica->cuttable = true;
    tissue_set_kind(&plica->tissue, TISSUE_SYNOVIUM);
    for (int tissue = 0; tissue < 2; tissue++) {
        struct wanted rim = {.like = about(METRIC_RIM, -1)},
                      removed = {.like = about(METRIC_REMOVED, -1)};
        rim.like.tissue = removed.like.tissue = tissue;
        metrics_each(&m, knee, look, &rim);
        metrics_each(&m, knee, look, &removed);
        assert_int_equal(rim.count, tissue);
        assert_int_equal(removed.count, 1);
    }
    case_destroy(&knee);
}

static void undone_cuts_count_and_what_they_took_does_not(void **state) {
    (void)state;
    static struct metrics m;
    static struct moment at;
    metrics_init(&m, instruments_usual(), optic);
    static const double removed_mm3[] = {5, 9, 5, 0};
    for (int i = 0; i < 4; i++) {
        struct tissue_figures f = {.cuts = i < 2 ? 1 + (uint32_t)i : 3 - (uint32_t)i};
        f.quality.removed_mm3 = removed_mm3[i];
        moment_init(&at, i * 100 * MS);
        at.output.landed = (struct landed){.job = 1 + (uint64_t)i, .figures = f};
        at.output.events = i < 2 ? EVENT_CUT : EVENT_UNDONE;
        take(&m, &at);
    }
    struct metric_value like = about(METRIC_CUTS_UNDONE, -1);
    like.tissue = 0;
    assert_true(figure(&m, like) == 2);
    like.metric = METRIC_CUTS;
    assert_true(figure(&m, like) == 0);
    like.metric = METRIC_REMOVED;
    assert_true(figure(&m, like) == 0);
}

// ---- words --------------------------------------------------------------------------------------

static void figures_say_what_they_are_about(void **state) {
    (void)state;
    static struct knee_case knee = {
        .group_count = 3,
        .groups = {{.name = "femur"},
                   {.name = "meniscus_medial", .cuttable = true},
                   {.name = "a_very_long_name_that_somebody_gave_to_the_lateral_meniscus",
                    .cuttable = true}},
    };
    const struct {
        struct metric_value about;
        const char *text, *without_case;
    } rows[] = {
        {{.instrument = -1, -1, -1, -1, -1, -1}, "", ""},
        {{.instrument = PROBE, -1, -1, -1, -1, -1, "probe"}, "probe", "probe"},
        {{.instrument = SCOPE, 0, -1, -1, -1, -1, "scope"}, "scope femur", "scope group-0"},
        {{.instrument = PROBE, 7, 1, -1, -1, -1, "probe"},
         "probe group-7 from 0.5 mm",
         "probe group-7 from 0.5 mm"},
        {{.instrument = -1, -1, -1, 0, 1, 0}, "meniscus_medial body.inner", "tissue-0 body.inner"},
        {{.instrument = -1, -1, -1, 1, 2, 2},
         "a_very_long_name_that_somebody posterior_horn.outer",
         "tissue-1 posterior_horn.outer"},
        {{.instrument = -1, -1, -1, 3, -1, -1}, "tissue-3", "tissue-3"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char text[SUBJECT_MAX];
        subject_text(&knee, &rows[i].about, text);
        assert_string_equal(text, rows[i].text);
        subject_text(NULL, &rows[i].about, text);
        assert_string_equal(text, rows[i].without_case);
    }
}

// ---- the table ----------------------------------------------------------------------------------

static void the_document_has_every_metric_as_it_is(void **state) {
    (void)state;
    static char text[1 << 16];
    FILE *file = fopen(DOCUMENT, "r");
    assert_non_null(file);
    text[fread(text, 1, sizeof text - 1, file)] = '\0';
    fclose(file);
    for (int i = 0; i < METRIC_COUNT; i++) {
        const struct metric_kind *kind = &metric_kinds[i];
        char begin[128], end[160];
        snprintf(begin, sizeof begin, "\n| `%s` | %d | %s |", kind->name, kind->version,
                 kind->unit);
        snprintf(end, sizeof end, "| %s%s|\n", kind->floor, *kind->floor ? " " : "");
        char *row = strstr(text, begin);
        if (!row)
            fail_msg("no row '%s'", begin + 1);
        char *row_end = strchr(row + 1, '\n') + 1;
        if (strncmp(row_end - strlen(end), end, strlen(end)) != 0)
            fail_msg("the row of %s does not end with '%s'", kind->name, end);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(time_runs_while_the_session_does),
        cmocka_unit_test(a_reset_begins_anew),
        cmocka_unit_test(values_count_until_the_next_step_at_any_rate),
        cmocka_unit_test(trembling_at_a_threshold_counts_by_where_it_mostly_is),
        cmocka_unit_test(an_old_trace_tells_nothing_of_the_warp),
        cmocka_unit_test(a_hole_in_the_steps_counts_for_little),
        cmocka_unit_test(without_another_nothing_is_said_of_the_view),
        cmocka_unit_test(motion_is_timed_by_its_samples_and_not_by_steps),
        cmocka_unit_test(a_pause_is_never_bridged),
        cmocka_unit_test(time_while_the_server_was_down_does_not_count),
        cmocka_unit_test(slow_and_short_motion_is_below_its_floor),
        cmocka_unit_test(jerk_counts_where_it_is_over_the_noise),
        cmocka_unit_test(a_lost_or_foreign_sample_moves_nothing),
        cmocka_unit_test(two_hands_count_together),
        cmocka_unit_test(the_last_figures_of_each_tissue_stand),
        cmocka_unit_test(of_a_tissue_without_zones_rim_and_zones_are_not_told),
        cmocka_unit_test(undone_cuts_count_and_what_they_took_does_not),
        cmocka_unit_test(figures_say_what_they_are_about),
        cmocka_unit_test(the_document_has_every_metric_as_it_is),
    };
    return cmocka_run_group_tests_name("metrics", tests, NULL, NULL);
}
