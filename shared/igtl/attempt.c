#include "igtl/attempt.h"

#include <inttypes.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Who looks may not know how an exam goes.
static bool has_results(const struct igtl_attempt *attempt) {
    return attempt->purpose != ATTEMPT_EXAM;
}

// ---- what happens -------------------------------------------------------------------------------

static bool tell_begin(struct igtl_attempt *last, const struct igtl_attempt *now,
                       struct igtl_attempt_word *out) {
    if (last->number == now->number)
        return false;
    *last = (struct igtl_attempt){.number = now->number};
    snprintf(out->text, sizeof out->text, "begun %s", now->task);
    return true;
}

static bool tell_goal(struct igtl_attempt *last, const struct igtl_attempt *now,
                      struct igtl_attempt_word *out) {
    for (int i = 0; i < now->goal_count; i++) {
        bool was_met = last->goals[i].met;
        last->goals[i].met = now->goals[i].met;
        if (was_met || !now->goals[i].met)
            continue;
        snprintf(out->text, sizeof out->text, "goal %s", now->goals[i].name);
        return true;
    }
    return false;
}

static bool tell_error(struct igtl_attempt *last, const struct igtl_attempt *now,
                       struct igtl_attempt_word *out) {
    for (int i = 0; i < now->error_count; i++) {
        uint32_t before = last->errors[i].count;
        last->errors[i].count = now->errors[i].count;
        if (now->errors[i].count <= before)
            continue;
        snprintf(out->text, sizeof out->text, "error %s %" PRIu32, now->errors[i].name,
                 now->errors[i].count);
        return true;
    }
    return false;
}

static bool tell_end(struct igtl_attempt *last, const struct igtl_attempt *now,
                     struct igtl_attempt_word *out) {
    bool had_ended = last->ended;
    last->ended = now->ended;
    if (had_ended || !now->ended)
        return false;
    if (has_results(now))
        snprintf(out->text, sizeof out->text, "ended %s (%s)", verdict_name(now->verdict),
                 attempt_end_name(now->end));
    else
        snprintf(out->text, sizeof out->text, "ended");
    return true;
}

// ---- figures ------------------------------------------------------------------------------------

static void add(struct igtl_attempt_word *out, const char *format, ...)
    __attribute__((format(printf, 2, 3)));
static void add(struct igtl_attempt_word *out, const char *format, ...) {
    size_t used = strlen(out->text);
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(out->text + used, sizeof out->text - used, format, arguments);
    va_end(arguments);
}

static void add_counts(struct igtl_attempt_word *out, const struct igtl_attempt *now) {
    uint32_t errors = 0;
    int met = 0;
    for (int i = 0; i < now->error_count; i++)
        errors += now->errors[i].count;
    for (int i = 0; i < now->goal_count; i++)
        met += now->goals[i].met;
    add(out, ",\"goals\":%d,\"goals_met\":%d,\"errors\":%" PRIu32, now->goal_count, met, errors);
}

// Names have letters, digits, '.', '-' and '_' alone (task/task.h).
static void put_figures(struct igtl_attempt_word *out, const struct igtl_attempt *now) {
    out->text[0] = '\0';
    add(out, "{\"number\":%" PRIu32 ",\"task\":\"%s\",\"purpose\":\"%s\",\"hand\":\"%s\"",
        now->number, now->task, attempt_purpose_name(now->purpose), attempt_hand_name(now->hand));
    add(out, ",\"limit_s\":%.10g,\"ended\":%s", now->limit_s, now->ended ? "true" : "false");
    if (isfinite(now->time_s) && (has_results(now) || !now->ended))
        add(out, ",\"time_s\":%.1f", now->time_s);
    if (has_results(now) && now->goal_count)
        add_counts(out, now);
    if (has_results(now))
        add(out, ",\"end\":\"%s\",\"verdict\":\"%s\"", attempt_end_name(now->end),
            verdict_name(now->verdict));
    add(out, "}");
}

static bool tell_figures(struct igtl_attempt_told *told, const struct igtl_attempt *now,
                         int64_t utc_ns, struct igtl_attempt_word *out) {
    if (told->figures && llabs(utc_ns - told->utc_ns) < IGTL_PROGRESS_NS)
        return false;
    told->figures = true;
    told->utc_ns = utc_ns;
    out->device = IGTL_PROGRESS;
    put_figures(out, now);
    return true;
}

// ---- both ---------------------------------------------------------------------------------------

static bool tell_happening(struct igtl_attempt *last, const struct igtl_attempt *now,
                           struct igtl_attempt_word *out) {
    out->device = IGTL_ATTEMPT;
    return tell_begin(last, now, out) ||
           (has_results(now) && (tell_goal(last, now, out) || tell_error(last, now, out))) ||
           tell_end(last, now, out);
}

bool igtl_attempt_next(struct igtl_attempt_told *told, const struct igtl_attempt *now,
                       int64_t utc_ns, struct igtl_attempt_word *out) {
    if (!now->number) {
        *told = (struct igtl_attempt_told){.figures = false};
        return false;
    }
    if (!tell_happening(&told->last, now, out))
        return tell_figures(told, now, utc_ns, out);
    told->figures = false; // they follow
    return true;
}
