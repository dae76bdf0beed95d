#include "base/check.h"

#include "base/argument.h"
#include "base/clock.h"
#include "base/number.h"
#include "calibrate/noise.h"
#include "loop/loop.h"
#include "samples/runner.h"
#include "tools/findings.h"
#include "tools/tools.h"
#include "view/openigtlink.h"
#include "view/token.h"

#include <getopt.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define CHECK_POINTS_MAX 8192 // of one channel
#define DAY_S 86400
#define NOISE_MAX_MM 1.0
#define FORCE_AT_REST_MAX_N 0.5
#define CALIBRATION_DAYS 30
#define CALIBRATION_MAX 1.0 // mm, degrees
#define CERTIFICATE_DAYS 30
#define TIME_OFF_MAX_S 60
#define UNCERTAINTY_MAX_MS 5.0
#define ROUND_TRIP_MAX_MS 20.0
#define OTHER_SERVER_S 3.5 // for each further one, until it is tried

static const char check_help[] =
    "Usage: arthron-station check --config FILE [--seconds N] [--json]\n"
    "\n"
    "Checks the devices, the calibration, the certificate, the server and the clocks before "
    "class.\n"
    "Prints one line for each, and says what to do if it is not ready. Exits with 0 if all are\n"
    "ready, else with 1. Stop `arthron-station run` first if a device serves one program only.\n"
    "The server opens no session.\n"
    "\n"
    "  -c, --config FILE  the station's config\n"
    "  -t, --seconds N    how long to read the devices; 3. A silent server takes 3 s more\n"
    "  -j, --json         print JSON\n"
    "      --help         show this\n";

// The poses of one channel, for its noise.
struct track {
    int count;
    int64_t last_ns;
    vec3 points[CHECK_POINTS_MAX];
};

// The forces of one channel.
struct pressure {
    int count;
    double least_n, most_n;
};

struct check {
    struct station_config *config;
    struct findings findings;
    struct runner *runner;
    struct link *link;
    struct frame frame; // the newest
    struct track tracks[FRAME_SAMPLES_MAX];
    struct pressure pressures[FRAME_SAMPLES_MAX];
};

// ---- looking ------------------------------------------------------------------------------------

static void take_force(struct pressure *p, double force_n) {
    p->least_n = p->count ? fmin(p->least_n, force_n) : force_n;
    p->most_n = p->count ? fmax(p->most_n, force_n) : force_n;
    p->count++;
}

static void look_once(struct check *check) {
    check->frame = (struct frame){.count = 0};
    runner_newest(check->runner, clock_now_ns(), &check->frame);
    for (int i = 0; i < check->frame.count; i++) {
        const struct sample *sample = &check->frame.samples[i];
        struct track *track = &check->tracks[i];
        if (sample->kind == SAMPLE_FORCE && sample->validity == VALIDITY_OK)
            take_force(&check->pressures[i], sample->force_n);
        if (sample->kind != SAMPLE_POSE || sample->validity != VALIDITY_OK ||
            sample->time_ns <= track->last_ns || track->count == CHECK_POINTS_MAX)
            continue;
        track->last_ns = sample->time_ns;
        track->points[track->count++] = sample->T_mockup_body.translation;
    }
}

static void look(struct check *check, double seconds) {
    static const struct timespec look_again = {0, 1000000};
    int64_t end_ns = clock_now_ns() + (int64_t)(seconds * 1e9);
    while (clock_now_ns() < end_ns) {
        look_once(check);
        nanosleep(&look_again, NULL);
    }
}

// ---- devices ------------------------------------------------------------------------------------

static double noise_of_device(const struct check *check, int device) {
    double noise_mm = 0;
    for (int i = 0; i < check->frame.count; i++)
        if (check->frame.samples[i].device == device)
            noise_mm =
                fmax(noise_mm, noise_of_points(check->tracks[i].points, check->tracks[i].count));
    return noise_mm;
}

static void judge_device(struct check *check, int index) {
    struct device_status s;
    runner_status(check->runner, index, &s);
    struct findings *f = &check->findings;
    double noise_mm = noise_of_device(check, index);
    if (!s.connected) {
        findings_add(f, false, s.name, "check its power, its cable and its address in the config",
                     "%s", s.problem[0] ? s.problem : "not connected");
        return;
    }
    const char *advice =
        !s.readings
            ? "it sends nothing that the config names: restart it, or correct names and registers"
        : s.malformed * 100 > s.readings ? "check its cable and its settings"
        : s.jumps ? "remove metal, mirrors and other markers near the tracker"
        : noise_mm > NOISE_MAX_MM
            ? "clean the markers, and check their distance and the tracker's cable"
            : NULL;
    findings_add(f, !advice, s.name, advice,
                 "%s: %.0f readings/s, %" PRIu64 " malformed, %" PRIu64 " jumps, noise %.2f mm%s%s",
                 s.driver, s.rate_hz, s.malformed, s.jumps, noise_mm, s.problem[0] ? "; " : "",
                 s.problem);
}

static const char *option_of(const struct device_config *device, const char *key) {
    for (int i = 0; i < device->option_count; i++)
        if (!strcmp(device->options[i].key, key))
            return device->options[i].value;
    return NULL;
}

// Nothing tells here whether a tracker is late, so a station may be ready without it.
static void judge_delays(struct check *check) {
    for (int i = 0; i < check->config->device_count; i++) {
        const struct device_config *device = &check->config->devices[i].config;
        const char *driver = option_of(device, "driver"), *delay = option_of(device, "delay_ms");
        char what[sizeof device->name + 16];
        if (!driver || strcmp(driver, "tracker") != 0)
            continue;
        snprintf(what, sizeof what, "%s's delay", device->name);
        if (delay)
            findings_add(&check->findings, true, what, NULL, "%s ms", delay);
        else
            findings_add(&check->findings, true, what, NULL,
                         "none is set, so a late tracker moves tools against the bones: run "
                         "arthron-station calibrate delay");
    }
}

static void judge_channels(struct check *check) {
    for (int i = 0; i < check->frame.count; i++) {
        const struct sample *sample = &check->frame.samples[i];
        struct device_status s;
        runner_status(check->runner, sample->device, &s);
        if (s.connected && sample->validity == VALIDITY_LOST)
            findings_add(&check->findings, false, channel_name(sample->channel),
                         "bring it into view, or correct its name or register in the config",
                         "[device %s] sends no value for it", s.name);
    }
}

// At rest, nothing presses an instrument. A bone's gauge may carry the leg.
static void judge_forces(struct check *check) {
    for (int i = 0; i < check->frame.count; i++) {
        const struct pressure *p = &check->pressures[i];
        const struct sample *sample = &check->frame.samples[i];
        char what[CHANNEL_NAME_MAX + 16];
        if (!p->count)
            continue;
        bool rests = sample->channel < CHANNEL_FIRST_INSTRUMENT ||
                     fmax(fabs(p->least_n), fabs(p->most_n)) <= FORCE_AT_REST_MAX_N;
        snprintf(what, sizeof what, "%s's force", channel_name(sample->channel));
        findings_add(&check->findings, rests, what,
                     "lay the instrument down and check again; if it is still pressed, correct "
                     "zero.CHANNEL in the config (docs/CONFIG.md)",
                     "%.2f to %.2f N", p->least_n, p->most_n);
    }
}

// ---- calibration --------------------------------------------------------------------------------

static void judge_calibration(struct check *check) {
    static const char what[] = "calibration", advice[] = "run arthron-station calibrate";
    const struct calibration *c = &check->config->calibration;
    struct findings *f = &check->findings;
    if (!c->count) {
        bool named = check->config->calibration_path[0];
        findings_add(
            f, false, what,
            named ? advice
                  : "add calibration = FILE to [station], then run arthron-station calibrate",
            "%s", named ? "the station has none yet" : "the config names no calibration file");
        return;
    }
    struct calibration_summary s = calibration_summarise(c);
    int64_t age_s = clock_utc_ns() / NS_PER_S - s.utc_s;
    bool good = age_s >= -DAY_S && age_s <= CALIBRATION_DAYS * DAY_S &&
                s.residual_mm <= CALIBRATION_MAX && s.residual_deg <= CALIBRATION_MAX;
    findings_add(f, good, what, advice,
                 "%d parts, the oldest is %" PRId64 " days old, residuals %.2f mm, %.2f degrees",
                 c->count, age_s / DAY_S, s.residual_mm, s.residual_deg);
}

// ---- server -------------------------------------------------------------------------------------

static const char enrol_advice[] = "enrol the station again: run `arthron-server keys enrol` on "
                                   "the server, then `arthron-station enrol` here";
static const char clock_advice[] = "set this machine's clock, and let it follow a time server";
static const char ended_advice[] =
    "set this machine's clock if it is wrong; else enrol the station again";

static void write_date(int64_t utc_s, char out[32]) {
    time_t seconds = (time_t)utc_s;
    struct tm utc;
    gmtime_r(&seconds, &utc);
    strftime(out, 32, "%Y-%m-%d %H:%M UTC", &utc);
}

static void judge_certificate(struct check *check) {
    static const char what[] = "certificate";
    static const char advice[] =
        "run the station, which renews it, or enrol the station again (docs/INSTALL.md)";
    int64_t begin_s, end_s, now_s = clock_utc_ns() / NS_PER_S;
    struct error err;
    if (link_certificate_times(check->config->keys_dir, &begin_s, &end_s, &err) != RESULT_OK) {
        findings_add(&check->findings, false, what, enrol_advice, "%s", err.text);
        return;
    }
    if (now_s < begin_s || now_s > end_s) {
        char limit[32], now[32];
        write_date(now_s < begin_s ? begin_s : end_s, limit);
        write_date(now_s, now);
        findings_add(&check->findings, false, what, now_s < begin_s ? clock_advice : ended_advice,
                     "%s at %s; this machine's clock says %s",
                     now_s < begin_s ? "it begins" : "it ended", limit, now);
        return;
    }
    int64_t days = (end_s - now_s) / DAY_S;
    findings_add(&check->findings, days >= CERTIFICATE_DAYS, what, advice,
                 "good for %" PRId64 " days", days);
}

static const char *advice_for(const struct link_status *s) {
    if (!s->refusal[0])
        return s->clock_is_wrong ? clock_advice
                                 : "check that the server runs, and check host, port and network";
    switch (s->refusal_reason) {
    case arthron_Refusal_Reason_IDENTITY:
        return enrol_advice;
    case arthron_Refusal_Reason_NO_CASE:
        return "give the station a case in the server's config";
    case arthron_Refusal_Reason_BUSY:
        return "end the other program that runs as this station";
    case arthron_Refusal_Reason_VERSION:
        return "install the same version on the station and on the server";
    default:
        return "read the server's log";
    }
}

static void judge_time(struct check *check, const struct link_status *s) {
    char ours[32];
    int64_t off_s = s->utc_ahead_s < 0 ? -s->utc_ahead_s : s->utc_ahead_s;
    if (!s->utc_known)
        return;
    write_date(clock_utc_ns() / NS_PER_S, ours);
    if (off_s <= TIME_OFF_MAX_S)
        findings_add(&check->findings, true, "time of day", NULL, "%s, the same as the server's",
                     ours);
    else
        findings_add(&check->findings, false, "time of day",
                     "set the clock that is wrong, and let both follow a time server",
                     "%s; the server's clock is %.1f days %s this one", ours, (double)off_s / DAY_S,
                     s->utc_ahead_s > 0 ? "ahead of" : "behind");
}

static void judge_server(struct check *check) {
    struct findings *f = &check->findings;
    const struct station_config *c = check->config;
    struct link_status s = {.server = c->servers[0]};
    if (check->link)
        link_get_status(check->link, &s);
    const struct server_address *server = &s.server;
    if (!s.welcomed || !s.clock_known) {
        findings_add(
            f, false, "server", advice_for(&s), "%s, port %d: %s", server->host, server->port,
            s.refusal[0]   ? s.refusal
            : s.problem[0] ? s.problem
                           : "the server has not answered yet: allow more time with --seconds");
        return;
    }
    judge_time(check, &s);
    double uncertainty_ms = (double)s.clock_uncertainty_ns / 1e6;
    double round_trip_ms = (double)s.round_trip_ns / 1e6;
    findings_add(f, true, "server", NULL, "%s, port %d: connected, case %s", server->host,
                 server->port, s.session_case);
    int64_t days = (s.server_until_utc_s - clock_utc_ns() / NS_PER_S) / DAY_S;
    findings_add(f, days >= CERTIFICATE_DAYS, "server's certificate",
                 "run arthron-server keys renew on the server", "good for %" PRId64 " days", days);
    findings_add(f, uncertainty_ms <= UNCERTAINTY_MAX_MS, "clock",
                 "use a network cable, or a network with less traffic",
                 "offset to the server's clock known within %.2f ms", uncertainty_ms);
    findings_add(f, round_trip_ms <= ROUND_TRIP_MAX_MS, "round trip",
                 "use a network cable, or a network with less traffic", "%.2f ms", round_trip_ms);
}

// ---- view ---------------------------------------------------------------------------------------

static void judge_view(struct check *check) {
    const struct view_config *view = &check->config->view;
    struct error err;
    if (!view->port)
        return;
    static const char *const uses[] = {
        [VIEW_PORT_FREE] = "is free",
        [VIEW_PORT_VIEW] = "serves the view of a running station",
        [VIEW_PORT_TAKEN] = "is used by another program",
    };
    enum view_port_use use = view_look_at_port(view->port);
    bool taken = use == VIEW_PORT_TAKEN, secret = token_check(view->token_path, &err) == RESULT_OK;
    findings_add(&check->findings, !taken && secret, "view",
                 taken ? "stop that program, or choose another port in [view]"
                       : "run chmod 600 on the file, or delete it: the station makes a new one",
                 "port %d %s%s%s", view->port, uses[use], secret ? "" : "; ",
                 secret ? "" : err.text);
}

static void judge_openigtlink(struct check *check) {
    const struct igtl_server_config *config = &check->config->openigtlink;
    struct error err;
    if (!config->port)
        return;
    enum view_port_use use = openigtlink_look_at_port(config, &err);
    if (use == VIEW_PORT_TAKEN)
        findings_add(&check->findings, false, "openigtlink",
                     "stop that program, or choose another port or address in [openigtlink]", "%s",
                     err.text);
    else
        findings_add(&check->findings, true, "openigtlink", "", "port %d %s", config->port,
                     use == VIEW_PORT_FREE ? "is free" : "serves a running station");
}

// ---- the whole ----------------------------------------------------------------------------------

static enum result start_check(struct check *check, struct error *err) {
    struct station_config *config = check->config;
    struct device_config devices[STATION_DEVICES_MAX];
    enum result result = station_config_calibrate(config, err);
    for (int i = 0; i < config->device_count; i++)
        devices[i] = config->devices[i].config;
    if (result == RESULT_OK)
        result = runner_create(devices, config->device_count, &check->runner, err);
    if (result != RESULT_OK)
        return result;
    struct link_config link = loop_link_config(config);
    link.visit = true;
    if (link_create(&link, &check->link, err) != RESULT_OK) {
        findings_add(&check->findings, false, "keys", "run arthron-station enrol", "%s", err->text);
        check->link = NULL;
    }
    return RESULT_OK;
}

static void judge_check(struct check *check) {
    for (int i = 0; i < runner_count(check->runner); i++)
        judge_device(check, i);
    judge_delays(check);
    judge_channels(check);
    judge_forces(check);
    judge_calibration(check);
    judge_certificate(check);
    judge_server(check);
    judge_view(check);
    judge_openigtlink(check);
}

// A silent server takes its time before the next one is tried.
static void wait_for_others(struct check *check) {
    struct link_status s;
    double patience_s = OTHER_SERVER_S * (check->config->server_count - 1);
    for (int64_t end_ns = clock_now_ns() + (int64_t)(patience_s * 1e9);
         check->link && clock_now_ns() < end_ns; look(check, 0.05)) {
        link_get_status(check->link, &s);
        if (s.welcomed && s.clock_known)
            return;
    }
}

static void examine(struct check *check, const char *path, double seconds) {
    struct error err;
    enum result result = station_config_load(path, NULL, 0, &check->config, &err);
    if (result == RESULT_OK)
        result = start_check(check, &err);
    if (result != RESULT_OK) {
        findings_add(&check->findings, false, "config", "correct the file (docs/CONFIG.md)", "%s",
                     err.text);
        return;
    }
    look(check, seconds);
    wait_for_others(check);
    judge_check(check);
}

static int run_check(const char *path, double seconds, bool json) {
    struct check *check = alloc(1, sizeof *check);
    examine(check, path, seconds);
    const char *station = check->config ? check->config->name : path;
    if (json)
        findings_print_json(&check->findings, station);
    else
        findings_print(&check->findings, station);
    int code = findings_are_good(&check->findings) ? 0 : 1;
    if (check->link)
        link_destroy(&check->link);
    runner_destroy(&check->runner);
    if (check->config)
        station_config_destroy(&check->config);
    free(check);
    return code;
}

int tool_check(int argc, char **argv) {
    static const struct option options[] = {
        {"config", required_argument, NULL, 'c'},
        {"seconds", required_argument, NULL, 't'},
        {"json", no_argument, NULL, 'j'},
        {"help", no_argument, NULL, 'h'},
        {0},
    };
    static const char program[] = "arthron-station check";
    const char *path = NULL;
    double seconds = 3;
    bool json = false;
    for (int o; (o = getopt_long(argc, argv, "c:t:j", options, NULL)) != -1;) {
        if (o == 'h') {
            fputs(check_help, stdout);
            return 0;
        }
        if (o == '?')
            return argument_help(program);
        if (o == 't' && !number_double(optarg, 1.2, 600, &seconds))
            return argument_wrong(program, "--seconds %s: must be from 1.2 to 600", optarg);
        path = o == 'c' ? optarg : path;
        json |= o == 'j';
    }
    if (optind != argc)
        return argument_wrong(program, "takes no %s", argv[optind]);
    if (!path)
        return argument_wrong(program, "--config is required");
    return run_check(path, seconds, json);
}
