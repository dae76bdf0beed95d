#include "base/check.h"
#include "base/clock.h"
#include "devices.h"
#include "folder.h"
#include "scene/played.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

// What is asked of each line; NULL: it has no such fault, or (a handle's, which a hand may move in
// any way and whose reports have neither number nor time) none that anyone could tell.
static const struct planned {
    const char *what, *modbus, *tracker, *hid; // values, "-": the fault takes none
    bool slow;                                 // to recover from
} plan[] = {
    {"dropout", "-", "-", "-"},
    {"freeze", "-", "-"},
    {"jump", "60", "200"},
    {"noise", "10", "10"},
    {"nan", "-", "-"},
    {"late", "120", "400"},
    {"stale", "2000", "2000"},
    {"junk", "-", "-", "-"},
    {"wrong-slave", "-", NULL},
    {"unplug", "-", "-", "-"},
    {"clock-step", NULL, "3", .slow = true},
    {"clock-drift", NULL, "0.5", .slow = true},
    {"newer-version", "-", "-"},
    {"half-message", "-", "-", "-"},
};

enum { FAULTS = sizeof plan / sizeof plan[0] };

static const char *asked_of(enum line line, int fault) {
    return line == TRACKER ? plan[fault].tracker
           : line == HID   ? plan[fault].hid
                           : plan[fault].modbus;
}

static const double loop_hz = 200, first_s = 1.5;
static const double steady_s = 0.1; // good for so long: recovered
// That far from where it was at its own time.
static const double wrong_deg = 1, wrong_mm = 5, wrong_opening = 0.02;

// One fault on one line, as a session sees it.
struct outcome {
    double noticed_s, recovered_s; // after its beginning, after its end; NaN: never
    double held_s, lost_s;         // of what the session was told
    int wrong;                     // frames whose value was OK and false
    double good_since_s;           // NaN: it is not
    struct device_status before, after;
    bool event_lost, event_back;
};

struct watched {
    struct runner *runner; // NULL: not chosen
    struct session *session;
    double offset; // of values, learnt while all is well
    int healthy;
    struct outcome outcomes[FAULTS];
};

struct times {
    double fault_s, pause_s, slow_pause_s;
};

void sleep_until(int64_t time_ns) {
    struct timespec at = {time_ns / NS_PER_S, time_ns % NS_PER_S};
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, NULL);
}

static double begin_of(const struct times *t, int fault) {
    double s = first_s;
    for (int i = 0; i < fault; i++)
        s += t->fault_s + (plan[i].slow ? t->slow_pause_s : t->pause_s);
    return s;
}

// ---- the script ----

static void write_fault(FILE *out, const struct times *t, int i, const char *who,
                        const char *value) {
    if (!value)
        return;
    fprintf(out, "[fault %s-%s]\nwho = %s\nwhat = %s\nat_s = %g\nfor_s = %g\n", who, plan[i].what,
            who, plan[i].what, begin_of(t, i), t->fault_s);
    if (*value != '-')
        fprintf(out, "value = %s\n", value);
}

static char *script(const struct times *t) {
    char *text;
    size_t size;
    FILE *out = open_memstream(&text, &size);
    for (int i = 0; i < FAULTS; i++) {
        write_fault(out, t, i, "modbus", plan[i].modbus);
        write_fault(out, t, i, "tracker", plan[i].tracker);
        write_fault(out, t, i, "hid", plan[i].hid);
    }
    fclose(out);
    return text;
}

// ---- watching ----

static enum result open_lines(const struct mockup *m, const bool chosen[LINES],
                              const struct scene *scene, struct watched *lines, struct error *err) {
    struct session_settings settings = session_settings_default();
    enum result result = RESULT_OK;
    for (int i = 0; i < MOCKUP_LINES && result == RESULT_OK; i++) {
        if (!chosen[i])
            continue;
        lines[i].session = session_create(scene, &settings);
        result = line_open(m, (enum line)i, loop_hz, &lines[i].runner, err);
    }
    return result;
}

// How far a value lies from what the motion has at the value's own time, in units of what counts as
// wrong.
static double falsehood(struct watched *line, const struct sample *s, const struct mockup *m,
                        bool learn) {
    double seconds = (double)(s->time_ns - m->start_ns) / NS_PER_S, off, wrong;
    if (s->kind == SAMPLE_JOINT) {
        off = s->joint.flexion_deg - seconds * MOTION_DEG_PER_S;
        wrong = wrong_deg;
    } else if (s->kind == SAMPLE_HANDLE) {
        off = s->handle.opening - seconds * MOTION_OPENING_PER_S;
        wrong = wrong_opening;
    } else {
        off = s->T_mockup_body.translation.x - seconds * MOTION_MM_PER_S;
        wrong = wrong_mm;
    }
    if (learn)
        line->offset += (off - line->offset) / ++line->healthy;
    return fabs(off - line->offset) / wrong;
}

static bool counters_rose(const struct device_status *a, const struct device_status *b) {
    return b->timeouts + b->malformed + b->skipped + b->jumps + b->noisy + b->losses +
                   b->reopenings >
               a->timeouts + a->malformed + a->skipped + a->jumps + a->noisy + a->losses +
                   a->reopenings ||
           (a->connected && !b->connected);
}

// Of a handle a session tells no validity: it is the sample's.
static enum validity validity_told(const struct frame *frame, const struct session_output *output) {
    const struct instrument_output *probe =
        &output->instruments[CHANNEL_PROBE - CHANNEL_FIRST_INSTRUMENT];
    switch (frame->samples[0].kind) {
    case SAMPLE_JOINT:
        return output->joint_validity;
    case SAMPLE_HANDLE:
        return frame->samples[0].validity;
    default:
        return probe->present ? probe->validity : VALIDITY_LOST;
    }
}

static void step_session(struct watched *line, const struct frame *frame, struct outcome *o) {
    struct session_input input = {.kind = INPUT_FRAME, .time_ns = frame->time_ns, .frame = *frame};
    struct session_output output;
    session_step(line->session, &input, &output);
    o->event_lost |= (output.events & EVENT_DEVICE_LOST) != 0;
    o->event_back |= (output.events & EVENT_DEVICE_BACK) != 0;
    enum validity v = validity_told(frame, &output);
    o->held_s += (v == VALIDITY_HELD) / loop_hz;
    o->lost_s += (v == VALIDITY_LOST) / loop_hz;
}

// `into_s`: since the fault's beginning, to the beginning of the next one.
static void watch(struct watched *line, struct outcome *o, const struct mockup *m, double into_s,
                  double fault_s, uint64_t tick) {
    struct frame frame = {.number = tick, .time_ns = clock_now_ns()};
    runner_collect(line->runner, frame.time_ns, &frame);
    runner_status(line->runner, 0, &o->after);
    const struct sample *s = &frame.samples[0];
    bool ok = s->validity == VALIDITY_OK;
    bool wrong = ok && falsehood(line, s, m, false) > 1;
    step_session(line, &frame, o);
    if (isnan(o->noticed_s) && (!ok || counters_rose(&o->before, &o->after)))
        o->noticed_s = into_s;
    o->wrong += wrong;
    if (into_s < fault_s || !ok || wrong)
        o->good_since_s = NAN;
    else if (isnan(o->good_since_s))
        o->good_since_s = into_s;
    if (isnan(o->recovered_s) && into_s - o->good_since_s >= steady_s)
        o->recovered_s = o->good_since_s - fault_s;
}

static void begin(struct watched *line, int fault) {
    struct outcome *o = &line->outcomes[fault];
    *o = (struct outcome){.noticed_s = NAN, .recovered_s = NAN, .good_since_s = NAN};
    runner_status(line->runner, 0, &o->before);
    o->after = o->before;
}

static void learn(struct watched *line, const struct mockup *m, uint64_t tick) {
    struct session_input input = {tick == 1 ? INPUT_START : INPUT_FRAME, clock_now_ns()};
    struct session_output output;
    input.frame = (struct frame){.number = tick, .time_ns = input.time_ns};
    runner_collect(line->runner, input.time_ns, &input.frame);
    if (input.frame.samples[0].validity == VALIDITY_OK)
        falsehood(line, &input.frame.samples[0], m, true);
    session_step(line->session, &input, &output);
}

static void watch_all(struct watched *lines, const struct mockup *m, const struct times *t) {
    double end_s = begin_of(t, FAULTS);
    int fault = -1;
    for (uint64_t tick = 1;; tick++) {
        sleep_until(m->start_ns + (int64_t)((double)tick / loop_hz * NS_PER_S));
        double now_s = (double)(clock_now_ns() - m->start_ns) / NS_PER_S;
        if (now_s >= end_s)
            return;
        bool next = now_s >= begin_of(t, fault + 1);
        fault += next;
        for (int i = 0; i < MOCKUP_LINES; i++) {
            if (!lines[i].runner)
                continue;
            if (next)
                begin(&lines[i], fault);
            if (fault < 0)
                learn(&lines[i], m, tick);
            else
                watch(&lines[i], &lines[i].outcomes[fault], m, now_s - begin_of(t, fault),
                      t->fault_s, tick);
        }
    }
}

// ---- what came of it ----

static void report_outcome(const struct outcome *o, const char *line, const char *what,
                           struct report *report) {
    char name[64], text[256];
    const struct device_status *a = &o->before, *b = &o->after;
    report_figure(report, o->noticed_s, "s", "%s/%s/notice", line, what);
    report_figure(report, o->recovered_s, "s", "%s/%s/recover", line, what);
    report_figure(report, o->wrong, "frames", "%s/%s/wrong", line, what);
    snprintf(name, sizeof name, "%s/%s", line, what);
    snprintf(text, sizeof text,
             "session held %.2f s, lost %.2f s%s%s; %u timeouts, %u malformed, %u skipped, %u "
             "jumps, %u reopenings",
             o->held_s, o->lost_s, o->event_lost ? ", said so" : "",
             o->event_back ? ", said back" : "", (unsigned)(b->timeouts - a->timeouts),
             (unsigned)(b->malformed - a->malformed), (unsigned)(b->skipped - a->skipped),
             (unsigned)(b->jumps - a->jumps), (unsigned)(b->reopenings - a->reopenings));
    report_text(report, name, text);
}

static void report_all(const struct watched *lines, struct report *report) {
    double unnoticed = 0, slowest_s = 0, wrong = 0;
    for (int i = 0; i < MOCKUP_LINES; i++)
        for (int k = 0; k < FAULTS; k++) {
            if (!lines[i].runner || !asked_of((enum line)i, k))
                continue;
            const struct outcome *o = &lines[i].outcomes[k];
            report_outcome(o, line_name((enum line)i), plan[k].what, report);
            unnoticed += isnan(o->noticed_s);
            slowest_s = isnan(o->recovered_s) ? INFINITY : fmax(slowest_s, o->recovered_s);
            wrong += o->wrong;
        }
    report_mark(report, "fault_unnoticed", unnoticed, "faults", 0, BETTER_LOW);
    report_mark(report, "recover_s_max", slowest_s, "s", 2, BETTER_LOW);
    report_figure(report, wrong, "frames", "wrong_passed");
}

static enum result run_script(const bool chosen[LINES], const struct scene *scene,
                              const struct times *t, struct report *report, struct error *err) {
    struct watched lines[MOCKUP_LINES] = {0};
    struct mockup mockup;
    char *faults = script(t);
    enum result result = mockup_start(faults, loop_hz, &mockup, err);
    free(faults);
    if (result != RESULT_OK)
        return result;
    result = open_lines(&mockup, chosen, scene, lines, err);
    if (result == RESULT_OK) {
        watch_all(lines, &mockup, t);
        report_all(lines, report);
    }
    for (int i = 0; i < MOCKUP_LINES; i++) {
        runner_destroy(&lines[i].runner);
        if (lines[i].session)
            session_destroy(&lines[i].session);
    }
    mockup_end(&mockup);
    return result;
}

enum result bench_faults(const bool chosen[LINES], bool quick, struct report *report,
                         struct error *err) {
    const struct times times = quick ? (struct times){0.5, 1.2, 1.9} : (struct times){1, 4, 4};
    char folder[FOLDER_MAX];
    struct played played;
    folder_make(folder);
    enum result result = played_init(CASES, "healthy", folder, &played, err);
    if (result == RESULT_OK) {
        result = run_script(chosen, played.scene, &times, report, err);
        played_fini(&played);
    }
    folder_remove(folder);
    return result;
}
