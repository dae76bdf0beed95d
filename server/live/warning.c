#include "live/warning.h"

#include "base/clock.h"
#include "runtime/drift.h"
#include "runtime/reply.h"
#include "runtime/slowed.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#define LOSS_SHARE 0.02f
#define MUCH_LOSS_SHARE 0.05f
#define LATE_SHARE 0.1f
#define SLOW_US 100000
#define UNCERTAIN_US 5000
#define PAUSE_S 1.0f
#define DAY_S 86400
#define CERTIFICATE_WARNING_S (30 * DAY_S)

// The first of the highest urgency stays. `parameter` of the code, or NULL.
__attribute__((format(printf, 5, 6))) static void warn(arthron_Place *place, enum urgency urgency,
                                                       arthron_Why_Code code, const char *parameter,
                                                       const char *format, ...) {
    va_list args;
    if (place->urgency >= urgency)
        return;
    place->urgency = urgency;
    place->has_why = true;
    reply_why(code, parameter, &place->why);
    va_start(args, format);
    vsnprintf(place->warning, sizeof place->warning, format, args);
    va_end(args);
}

struct figure {
    char text[24];
};

static struct figure figure(double value, int digits) {
    struct figure f;
    snprintf(f.text, sizeof f.text, "%.*f", digits, value);
    return f;
}

static void warn_of_devices(arthron_Place *place) {
    for (int i = 0; i < place->devices_count; i++)
        if (place->devices[i].lost)
            warn(place, URGENCY_NOW, arthron_Why_Code_DEVICE_LOST, place->devices[i].name,
                 "device %s is lost", place->devices[i].name);
}

static void warn_of_link(arthron_Place *place) {
    const arthron_SessionInfo *info = &place->info;
    if (!info->connected)
        warn(place, URGENCY_NOW, arthron_Why_Code_STATION_AWAY, NULL,
             "its station is away, the session waits for it");
    if (place->pause_s > PAUSE_S)
        warn(place, URGENCY_NOW, arthron_Why_Code_NO_FRAMES, figure((double)place->pause_s, 0).text,
             "no frame came from its station for %.0f s", (double)place->pause_s);
    if (place->loss_share > LOSS_SHARE)
        warn(place, place->loss_share > MUCH_LOSS_SHARE ? URGENCY_ACT : URGENCY_LOOK,
             arthron_Why_Code_FRAMES_LOST, figure(100 * (double)place->loss_share, 0).text,
             "%.0f %% of its frames are lost", 100 * (double)place->loss_share);
}

// What it sends comes, but not as it should.
static void warn_of_way(arthron_Place *place) {
    const arthron_SessionInfo *info = &place->info;
    if (info->without_datagrams)
        warn(place, URGENCY_LOOK, arthron_Why_Code_NO_DATAGRAMS, NULL,
             "no datagram of its station comes, its poses come over TCP");
    if (info->rtt_p50_us > SLOW_US)
        warn(place, URGENCY_LOOK, arthron_Why_Code_SLOW_ANSWERS,
             figure(info->rtt_p50_us / 1000, 0).text, "its station waits %.0f ms for an answer",
             info->rtt_p50_us / 1000);
    if (place->late_share > LATE_SHARE)
        warn(place, URGENCY_LOOK, arthron_Why_Code_FRAMES_LATE,
             figure(100 * (double)place->late_share, 0).text, "%.0f %% of its frames come late",
             100 * (double)place->late_share);
    if (info->clock_step_ns)
        warn(place, URGENCY_LOOK, arthron_Why_Code_CLOCK_STEPPED,
             figure((double)info->clock_step_ns / NS_PER_S, 1).text,
             "its station's clock was stepped by %.1f s", (double)info->clock_step_ns / NS_PER_S);
    if (info->clock_uncertainty_us > UNCERTAIN_US)
        warn(place, URGENCY_LOOK, arthron_Why_Code_CLOCK_UNCERTAIN,
             figure(info->clock_uncertainty_us / 1000, 0).text, "clock uncertain by %.0f ms",
             info->clock_uncertainty_us / 1000);
}

static void warn_of_slowed(arthron_Place *place) {
    const arthron_SessionInfo *info = &place->info;
    if (info->slowed >> SLOWED_FRAMES & 1)
        warn(place, URGENCY_LOOK, arthron_Why_Code_TOO_MANY_FRAMES,
             figure((double)info->frames_excess, 0).text,
             "it sends more than its share: %" PRIu64 " frames were left out", info->frames_excess);
    if (info->slowed >> SLOWED_ASKS & 1)
        warn(place, URGENCY_LOOK, arthron_Why_Code_TOO_MANY_ASKS, NULL,
             "it asks for its meshes too often: they come later");
    if (info->slowed >> SLOWED_MESSAGES & 1)
        warn(place, URGENCY_LOOK, arthron_Why_Code_TOO_MANY_MESSAGES, NULL,
             "it sends too many messages: they are read later");
}

static void warn_of_trace(arthron_Place *place) {
    const arthron_SessionInfo *info = &place->info;
    if (info->trace_failing)
        warn(place, URGENCY_NOW, arthron_Why_Code_TRACE_FAILING, NULL,
             "its trace cannot be written to the disk");
    if (info->trace_missing)
        warn(place, URGENCY_ACT, arthron_Why_Code_TRACE_INCOMPLETE,
             figure((double)info->trace_missing, 0).text,
             "its trace is incomplete: %" PRIu64 " steps are missing", info->trace_missing);
    if (info->unprotected)
        warn(place, URGENCY_LOOK, arthron_Why_Code_UNPROTECTED, NULL,
             "no other server could go on with its session as it is");
}

static void warn_of_case(arthron_Place *place) {
    const char *grade = place->info.case_grade;
    bool unfit = !strcmp(grade, "unfit");
    if (!strncmp(grade, "fit", 3))
        return;
    warn(place, unfit ? URGENCY_ACT : URGENCY_LOOK, arthron_Why_Code_CASE_GRADE,
         place->info.case_name, "case %s is %s", place->info.case_name, grade);
    if (place->why.code == arthron_Why_Code_CASE_GRADE)
        reply_why_also(grade, &place->why);
}

// Stations renew their certificates by themselves, long before.
static void warn_of_certificate(arthron_Place *place) {
    int64_t end_s = place->info.certificate_until_utc_s;
    int64_t left_s = end_s - clock_utc_ns() / NS_PER_S;
    if (end_s && left_s < CERTIFICATE_WARNING_S)
        warn(place, URGENCY_LOOK, arthron_Why_Code_CERTIFICATE_ENDS,
             figure((double)(left_s / DAY_S), 0).text,
             "its certificate ends in %d days: enrol it again", (int)(left_s / DAY_S));
}

void warning_of_place(arthron_Place *place, double drift_mm) {
    const arthron_SessionInfo *info = &place->info;
    place->urgency = URGENCY_NONE;
    place->has_why = false;
    place->why = (arthron_Why){0};
    place->warning[0] = '\0';
    if (place->refused[0])
        warn(place, URGENCY_NOW, arthron_Why_Code_UNSAID, NULL, "%s", place->refused);
    if (info->state != arthron_SessionState_CLOSED) {
        if (info->connected)
            warn_of_slowed(place); // before the little loss that comes of it
        warn_of_link(place);
        if (info->connected) {
            warn_of_devices(place);
            warn_of_way(place);
        }
        warn_of_trace(place);
        if (info->touches >= DRIFT_TOUCHES && info->drift_mm > drift_mm)
            warn(place, URGENCY_ACT, arthron_Why_Code_OFF_SURFACE, figure(info->drift_mm, 2).text,
                 "tip is %.2f mm off the surface; recalibrate", info->drift_mm);
    }
    if (info->connected && info->calibration_problem[0])
        warn(place, URGENCY_LOOK, arthron_Why_Code_UNSAID, NULL, "%s", info->calibration_problem);
    warn_of_certificate(place);
    if (info->connected || info->state != arthron_SessionState_CLOSED)
        warn_of_case(place);
}
