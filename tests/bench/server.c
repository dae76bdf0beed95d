// arthron-bench server: a real server and its stations, over the real protocol, beside the least
// that any server of poses could do (echo.h). Both take turns on one processor; the stations are on
// another.
#include "base/clock.h"
#include "base/log.h"
#include "bench.h"
#include "busy.h"
#include "echo.h"
#include "generate/generate.h"
#include "hall.h"
#include "pipeline.h"
#include "step/scene.h"

#include <stdio.h>
#include <time.h>
#include <unistd.h>

#define SERVER_CPU 0
#define GROUPS 5 // the bones and the menisci
#define RESOLUTION_MM 1.2
#define BUSY_STATIONS 8
#define BUSY_HZ 1000
#define MANY_STATIONS 50
#define FEW_STATIONS 5
#define CROWD_HZ 100
#define ACTIVE_STATIONS 200
#define IDLE_STATIONS 1000
#define SETTLE_NS (2 * NS_PER_S)

struct rounds {
    int count;
    int64_t lasts_ns;
};

// What one server gave, as medians over the rounds.
struct figures {
    double rate_over_sealed_echo, rate_over_plain_echo, added_p50, added_p99, lost;
};

// ---- the case -----------------------------------------------------------------------------------

// Five groups of 22,000 triangles in the mean, some of them displaced.
static enum result make_case(const char *folder, char *out_dir, size_t size, struct error *err) {
    struct recipe recipe;
    struct knee_case *knee = NULL;
    snprintf(out_dir, size, "%s/case", folder);
    enum result result = recipe_load(CASES "/arthrosis", &recipe, err);
    recipe.resolution_mm = RESOLUTION_MM;
    if (result == RESULT_OK)
        result = generate_knee(&recipe, &knee, err);
    if (result != RESULT_OK)
        return result;
    int groups = knee->group_count;
    knee->group_count = GROUPS;
    result = case_save(knee, out_dir, err);
    knee->group_count = groups;
    case_destroy(&knee);
    return result;
}

// ---- the server beside the echoes ---------------------------------------------------------------

static double per_frame(int64_t ns, const struct load_result *result) {
    return (double)ns / (double)result->answered;
}

static double echo_round(struct echo *echo, const struct load *load, struct load_result *out) {
    int64_t before_ns = echo_ns(echo);
    load_run(echo->callers, echo->count, load, out);
    return per_frame(echo_ns(echo) - before_ns, out);
}

static double server_round(const struct hall *hall, int stations, const struct load *load,
                           struct load_result *out) {
    int64_t before_ns = hall_worker_ns(hall);
    load_run(hall->callers, stations, load, out);
    return per_frame(hall_worker_ns(hall) - before_ns, out);
}

struct ratios {
    struct samples sealed, plain, p50, p99, worker_ns, echo_ns;
    uint64_t sent, answered;
};

static void compare(const struct hall *hall, struct echo *sealed, struct echo *plain,
                    double rate_hz, const struct rounds *rounds, struct ratios *out) {
    struct load load = {rate_hz, rounds->lasts_ns};
    for (int i = 0; i < rounds->count; i++) {
        struct load_result of_sealed = {0}, of_plain = {0}, of_server = {0};
        double sealed_ns = echo_round(sealed, &load, &of_sealed);
        double worker_ns = server_round(hall, hall->caller_count, &load, &of_server);
        double plain_ns = echo_round(plain, &load, &of_plain);
        double floor_us = samples_quantile(&of_sealed.round_trips_us, 0.5);
        double late_us = samples_quantile(&of_sealed.round_trips_us, 0.99);
        samples_add(&out->sealed, sealed_ns / worker_ns);
        samples_add(&out->plain, plain_ns / worker_ns);
        samples_add(&out->p50, samples_quantile(&of_server.round_trips_us, 0.5) / floor_us - 1);
        samples_add(&out->p99, samples_quantile(&of_server.round_trips_us, 0.99) / late_us - 1);
        samples_add(&out->worker_ns, worker_ns);
        samples_add(&out->echo_ns, sealed_ns);
        out->sent += of_server.sent;
        out->answered += of_server.answered;
        load_result_fini(&of_sealed);
        load_result_fini(&of_plain);
        load_result_fini(&of_server);
    }
}

static void ratios_fini(struct ratios *r) {
    struct samples *all[] = {&r->sealed, &r->plain, &r->p50, &r->p99, &r->worker_ns, &r->echo_ns};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        samples_fini(all[i]);
}

static enum result start_echoes(struct echo *sealed, struct echo *plain, int callers,
                                struct error *err) {
    enum result result = echo_start(callers, true, SERVER_CPU, sealed, err);
    return result == RESULT_OK ? echo_start(callers, false, SERVER_CPU, plain, err) : result;
}

static void report_ratios(struct ratios *r, const char *field, struct report *report) {
    bool usual = !field;
    const char *name = field ? field : "default";
    report_mark(report, usual ? "rate_default_over_sealed_echo" : "rate_over_sealed_echo",
                samples_quantile(&r->sealed, 0.5), "1", usual ? 0.35 : 0.5, BETTER_HIGH);
    report_figure(report, samples_quantile(&r->plain, 0.5), "1", "%s/rate over plain echo", name);
    report_figure(report, samples_quantile(&r->worker_ns, 0.5) / 1e3, "us", "%s/worker a pose",
                  name);
    report_figure(report, samples_quantile(&r->echo_ns, 0.5) / 1e3, "us",
                  "%s/sealed echo a datagram", name);
}

static void report_added(struct ratios *r, struct report *report) {
    report_mark(report, "added_over_echo_p50", samples_quantile(&r->p50, 0.5), "1", 0.4,
                BETTER_LOW);
    report_mark(report, "added_over_echo_p99", samples_quantile(&r->p99, 0.5), "1", 1.0,
                BETTER_LOW);
}

// As fast as the stations can ask, which are too many for any to have more than its share.
static enum result rates(const struct hall *hall, const char *field, const struct rounds *rounds,
                         struct report *report, struct error *err) {
    struct echo sealed = {0}, plain = {0};
    struct ratios ratios = {0};
    enum result result = start_echoes(&sealed, &plain, hall->caller_count, err);
    if (result == RESULT_OK) {
        compare(hall, &sealed, &plain, 0, rounds, &ratios);
        report_ratios(&ratios, field, report);
    }
    echo_end(&sealed);
    echo_end(&plain);
    ratios_fini(&ratios);
    return result;
}

static enum result added(const struct hall *hall, const struct rounds *rounds,
                         struct report *report, struct error *err) {
    struct hall few = *hall;
    struct echo sealed = {0}, plain = {0};
    struct ratios ratios = {0};
    few.caller_count = BUSY_STATIONS;
    enum result result = start_echoes(&sealed, &plain, BUSY_STATIONS, err);
    if (result == RESULT_OK) {
        compare(&few, &sealed, &plain, BUSY_HZ, rounds, &ratios);
        report_added(&ratios, report);
    }
    echo_end(&sealed);
    echo_end(&plain);
    ratios_fini(&ratios);
    return result;
}

static enum result cheapest_field(const char *case_dir, const struct rounds *rounds,
                                  struct report *report, struct error *err) {
    struct hall hall;
    struct hall_setup setup = {MANY_STATIONS, case_dir, "inverse-distance", SERVER_CPU, 0};
    enum result result = hall_start(&setup, &hall, err);
    if (result != RESULT_OK)
        return result;
    result = rates(&hall, setup.field, rounds, report, err);
    hall_end(&hall);
    return result;
}

// ---- many stations ------------------------------------------------------------------------------

static void pause_ns(int64_t ns) {
    nanosleep(&(struct timespec){ns / NS_PER_S, ns % NS_PER_S}, NULL);
}

// Once what joining made has been done.
static double idle_share(const struct hall *hall, int64_t lasts_ns) {
    pause_ns(SETTLE_NS);
    int64_t before_ns = hall_server_ns(hall), begin_ns = clock_now_ns();
    pause_ns(lasts_ns);
    return (double)(hall_server_ns(hall) - before_ns) / (double)(clock_now_ns() - begin_ns);
}

static double growth(const struct hall *hall, const struct rounds *rounds) {
    struct load load = {CROWD_HZ, rounds->lasts_ns};
    struct samples ratios = {0};
    for (int i = 0; i < rounds->count; i++) {
        struct load_result few = {0}, many = {0};
        load.rate_hz = CROWD_HZ * (double)MANY_STATIONS / FEW_STATIONS;
        double few_ns = server_round(hall, FEW_STATIONS, &load, &few);
        load.rate_hz = CROWD_HZ;
        samples_add(&ratios, server_round(hall, MANY_STATIONS, &load, &many) / few_ns);
        load_result_fini(&few);
        load_result_fini(&many);
    }
    double median = samples_quantile(&ratios, 0.5);
    samples_fini(&ratios);
    return median;
}

static enum result memory_of(int stations, const char *case_dir, double *out_bytes,
                             struct error *err) {
    struct hall hall;
    enum result result =
        hall_start(&(struct hall_setup){stations, case_dir, NULL, SERVER_CPU, 0}, &hall, err);
    if (result != RESULT_OK)
        return result;
    *out_bytes = hall_memory(&hall);
    hall_end(&hall);
    return RESULT_OK;
}

static void report_crowd(const struct hall *hall, double few_bytes, const struct rounds *rounds,
                         struct report *report) {
    report_mark(report, "session_bytes",
                (hall_memory(hall) - few_bytes) / (MANY_STATIONS - FEW_STATIONS), "bytes", 2e6,
                BETTER_LOW);
    report_mark(report, "cost_growth_50_over_5", growth(hall, rounds), "1", 1.1, BETTER_LOW);
}

static enum result usual_field(const char *case_dir, const struct rounds *rounds,
                               struct report *report, struct error *err) {
    struct hall hall;
    double few_bytes;
    enum result result = memory_of(FEW_STATIONS, case_dir, &few_bytes, err);
    if (result == RESULT_OK)
        result = hall_start(&(struct hall_setup){MANY_STATIONS, case_dir, NULL, SERVER_CPU, 0},
                            &hall, err);
    if (result != RESULT_OK)
        return result;
    report_crowd(&hall, few_bytes, rounds, report);
    result = rates(&hall, NULL, rounds, report, err);
    if (result == RESULT_OK)
        result = added(&hall, rounds, report, err);
    hall_end(&hall);
    return result;
}

// ---- beside other programs ----------------------------------------------------------------------

static void report_busy(struct samples *idle, struct samples *busy, struct report *report) {
    double idle_us = samples_quantile(idle, 0.999), busy_us = samples_quantile(busy, 0.999);
    report_mark(report, "pose_p999_busy_over_idle", busy_us / idle_us, "1", 1.2, BETTER_LOW);
    report_figure(report, idle_us, "us", "idle/p999");
    report_figure(report, busy_us, "us", "busy/p999");
}

static enum result beside_others(const char *case_dir, const struct rounds *rounds,
                                 struct report *report, struct error *err) {
    struct hall hall;
    struct samples idle = {0}, busy = {0};
    struct hall_setup setup = {BUSY_STATIONS, case_dir, NULL, -1};
    bool granted = busy_grant();
    enum result result = granted ? hall_start(&setup, &hall, err) : RESULT_OK;
    if (result != RESULT_OK)
        return result;
    if (granted) {
        granted = busy_compare(&hall, rounds->count, rounds->lasts_ns, &idle, &busy);
        hall_end(&hall);
    }
    if (granted)
        report_busy(&idle, &busy, report);
    else
        report_text(report, "pose_p999_busy_over_idle",
                    "skipped: the system gives no real-time priority");
    samples_fini(&idle);
    samples_fini(&busy);
    return RESULT_OK;
}

// ---- two workers --------------------------------------------------------------------------------

static enum result two_threads(const char *folder, const char *case_dir,
                               const struct rounds *rounds, struct report *report,
                               struct error *err) {
    struct knee_case *knee = NULL;
    struct scene *scene = NULL;
    struct samples ratios = {0};
    enum result result = case_load(case_dir, NULL, &knee, err);
    if (result == RESULT_OK)
        result = scene_create(&knee, &scene, err);
    if (result == RESULT_OK)
        result = pipeline_two_over_one(scene, folder, rounds->count, &ratios, err);
    if (result == RESULT_OK)
        report_mark(report, "two_threads_over_one", samples_quantile(&ratios, 0.5), "1", 1.7,
                    BETTER_HIGH);
    samples_fini(&ratios);
    scene_destroy(&scene);
    case_destroy(&knee);
    return result;
}

// ---- a large hall -------------------------------------------------------------------------------

static void report_large(const struct hall *hall, int idle, int64_t lasts_ns,
                         struct report *report) {
    struct load_result result = {0};
    struct load load = {CROWD_HZ, lasts_ns, .sleeps = true};
    report_mark(report, "idle_core_per_1000",
                idle_share(hall, lasts_ns) * 1000 / hall->station_count, "1", 0.05, BETTER_LOW);
    load_run(hall->callers, hall->caller_count, &load, &result);
    report_mark(report, "active_lost", (double)(result.sent - result.answered), "frames", 0,
                BETTER_LOW);
    report_figure(report, hall->caller_count, "stations", "large hall/of 100 Hz");
    report_figure(report, idle, "stations", "large hall/idle beside them");
    report_figure(report, (double)result.sent, "frames", "large hall/sent");
    report_figure(report, samples_quantile(&result.round_trips_us, 0.5), "us",
                  "large hall/round trip p50");
    report_figure(report, samples_quantile(&result.round_trips_us, 0.99), "us",
                  "large hall/round trip p99");
    report_figure(report, hall_memory(hall) / hall->station_count, "bytes",
                  "large hall/memory a station, with the case");
    load_result_fini(&result);
}

// With --quick the hall is a fifth as large.
static enum result large_hall(const char *case_dir, bool quick, struct report *report,
                              struct error *err) {
    struct hall hall;
    struct hall_setup setup = {ACTIVE_STATIONS, case_dir, NULL, -1, IDLE_STATIONS};
    if (quick) {
        setup.station_count /= 5;
        setup.idle /= 5;
    }
    enum result result = hall_start(&setup, &hall, err);
    if (result != RESULT_OK)
        return result;
    report_large(&hall, setup.idle, quick ? 2 * NS_PER_S : 10 * NS_PER_S, report);
    hall_end(&hall);
    return result;
}

enum result bench_server(const struct bench_options *options, struct report *report,
                         struct error *err) {
    struct rounds rounds = {options->quick ? 3 : 9, options->quick ? 3 * NS_PER_S / 10 : 2 * NS_PER_S};
    char folder[FOLDER_MAX], case_dir[128];
    log_set_level(LOG_WARNING);
    folder_make(folder);
    enum result result = make_case(folder, case_dir, sizeof case_dir, err);
    if (result == RESULT_OK)
        result = two_threads(folder, case_dir, &rounds, report, err);
    if (result == RESULT_OK)
        result = cheapest_field(case_dir, &rounds, report, err);
    if (result == RESULT_OK)
        result = beside_others(case_dir, &rounds, report, err);
    if (result == RESULT_OK)
        result = usual_field(case_dir, &rounds, report, err);
    if (result == RESULT_OK)
        result = large_hall(case_dir, options->quick, report, err);
    folder_remove(folder);
    return result;
}
