#include "faults.h"

#include "base/log.h"
#include "settings/settings.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#define OF(who) (1u << (who))
#define EVERYONE (OF(FAULT_MODBUS) | OF(FAULT_TRACKER) | OF(FAULT_HID))

static const char *const who_names[FAULT_WHO_COUNT + 1] = {"modbus", "tracker", "hid"};

static const char *const what_names[FAULT_WHAT_COUNT + 1] = {
    [FAULT_DROPOUT] = "dropout",
    [FAULT_FREEZE] = "freeze",
    [FAULT_JUMP] = "jump",
    [FAULT_NOISE] = "noise",
    [FAULT_NAN] = "nan",
    [FAULT_LATE] = "late",
    [FAULT_JITTER] = "jitter",
    [FAULT_STALE] = "stale",
    [FAULT_JUNK] = "junk",
    [FAULT_WRONG_SLAVE] = "wrong-slave",
    [FAULT_UNPLUG] = "unplug",
    [FAULT_CLOCK_STEP] = "clock-step",
    [FAULT_CLOCK_DRIFT] = "clock-drift",
    [FAULT_NEWER_VERSION] = "newer-version",
    [FAULT_HALF_MESSAGE] = "half-message",
    [FAULT_MISSING] = "missing",
};

static const struct fault_kind {
    unsigned whose;
    bool has_value;
} kinds[FAULT_WHAT_COUNT] = {
    [FAULT_DROPOUT] = {EVERYONE, false},
    [FAULT_FREEZE] = {EVERYONE, false},
    [FAULT_JUMP] = {EVERYONE, true},
    [FAULT_NOISE] = {EVERYONE, true},
    [FAULT_NAN] = {OF(FAULT_MODBUS) | OF(FAULT_TRACKER), false},
    [FAULT_LATE] = {EVERYONE, true},
    [FAULT_JITTER] = {OF(FAULT_TRACKER), true},
    [FAULT_STALE] = {EVERYONE, true},
    [FAULT_JUNK] = {EVERYONE, false},
    [FAULT_WRONG_SLAVE] = {OF(FAULT_MODBUS), false},
    [FAULT_UNPLUG] = {EVERYONE, false},
    [FAULT_CLOCK_STEP] = {OF(FAULT_TRACKER), true},
    [FAULT_CLOCK_DRIFT] = {OF(FAULT_TRACKER), true},
    [FAULT_NEWER_VERSION] = {OF(FAULT_MODBUS) | OF(FAULT_TRACKER), false},
    [FAULT_HALF_MESSAGE] = {EVERYONE, false},
    [FAULT_MISSING] = {OF(FAULT_TRACKER), false},
};

// ---- the file -----------------------------------------------------------------------------------

static void *find_fault(void *user, const char *name, struct error *err) {
    struct faults *f = user;
    for (int i = 0; i < f->count; i++)
        if (!strcmp(f->list[i].name, name))
            return &f->list[i];
    if (f->count == FAULTS_MAX || !setting_text(name, f->list[f->count].name, FAULT_NAME_MAX)) {
        fail(err, RESULT_LIMIT, "at most %d faults, of names of at most %d bytes", FAULTS_MAX,
             FAULT_NAME_MAX - 1);
        return NULL;
    }
    struct fault *fault = &f->list[f->count++];
    fault->who = FAULT_WHO_COUNT;
    fault->what = FAULT_WHAT_COUNT;
    fault->at_s = fault->for_s = fault->value = NAN;
    fault->every = 1;
    return fault;
}

#define IN_FAULT(member) SETTING_IN(struct fault, member)

static const struct setting_key fault_keys[] = {
    {"at_s", SETTING_NUMBER, IN_FAULT(at_s), 0, 1e6},
    {"for_s", SETTING_NUMBER, IN_FAULT(for_s), 0, 1e6},
    {"value", SETTING_NUMBER, IN_FAULT(value), -1e6, 1e6},
    {"who", SETTING_CHOICE, IN_FAULT(who), .choices = who_names},
    {"what", SETTING_CHOICE, IN_FAULT(what), .choices = what_names},
    {"every", SETTING_INTEGER, IN_FAULT(every), 1, 1000000},
    {0},
};
static const struct setting_section sections[] = {{"fault NAME", fault_keys, find_fault}, {0}};

static enum result check(const struct fault *f, struct error *err) {
    if (f->who == FAULT_WHO_COUNT || f->what == FAULT_WHAT_COUNT || isnan(f->at_s) ||
        isnan(f->for_s))
        return fail(err, RESULT_MISSING, "[fault %s]: needs at_s, for_s, who and what", f->name);
    const struct fault_kind *kind = &kinds[f->what];
    if (!(kind->whose & OF(f->who)))
        return fail(err, RESULT_INVALID, "[fault %s] what: %s has no %s", f->name,
                    who_names[f->who], what_names[f->what]);
    if (kind->has_value == isnan(f->value))
        return fail(err, kind->has_value ? RESULT_MISSING : RESULT_INVALID,
                    "[fault %s] value: %s %s value", f->name, what_names[f->what],
                    kind->has_value ? "needs a" : "takes no");
    bool is_time = f->what == FAULT_LATE || f->what == FAULT_JITTER || f->what == FAULT_STALE;
    if (is_time && (f->value < 0 || f->value > 10000))
        return fail(err, RESULT_INVALID, "[fault %s] value: 0 to 10000 ms", f->name);
    return RESULT_OK;
}

enum result faults_read(const char *path, struct faults *out, struct error *err) {
    enum result result = settings_load(path, NULL, 0, sections, out, err);
    for (int i = 0; i < out->count && result == RESULT_OK; i++)
        if ((result = check(&out->list[i], err)) != RESULT_OK)
            fail_in(err, result, "%s: ", path);
    return result;
}

// ---- what is on ---------------------------------------------------------------------------------

const struct fault *faults_on(const struct faults *f, enum fault_who who, enum fault_what what,
                              double seconds) {
    for (int i = 0; i < f->count; i++) {
        const struct fault *fault = &f->list[i];
        if (fault->who == who && fault->what == what && seconds >= fault->at_s &&
            seconds < fault->at_s + fault->for_s)
            return fault;
    }
    return NULL;
}

const struct fault *faults_strike(struct faults *f, enum fault_who who, enum fault_what what,
                                  double seconds) {
    const struct fault *on = faults_on(f, who, what, seconds);
    if (!on)
        return NULL;
    unsigned asked = atomic_fetch_add(&f->list[on - f->list].asked, 1) + 1;
    return asked % (unsigned)on->every ? NULL : on;
}

double faults_time(struct faults *f, enum fault_who who, double seconds) {
    const struct fault *freeze = faults_strike(f, who, FAULT_FREEZE, seconds);
    if (freeze)
        return freeze->at_s;
    const struct fault *stale = faults_strike(f, who, FAULT_STALE, seconds);
    return stale ? fmax(0, seconds - stale->value / 1e3) : seconds;
}

// ---- randomness ---------------------------------------------------------------------------------

static _Thread_local unsigned short random_state[3] = {1, 2, 3};

// Box and Muller
double faults_share(void) {
    return erand48(random_state);
}

double faults_noise(void) {
    double u = 1 - erand48(random_state);
    return sqrt(-2 * log(u)) * cos(2 * M_PI * erand48(random_state));
}

size_t faults_spoil(struct faults *f, enum fault_who who, double seconds, uint8_t *bytes,
                    size_t size) {
    if (faults_strike(f, who, FAULT_JUNK, seconds))
        for (size_t i = 0; i < size; i++)
            bytes[i] = (uint8_t)nrand48(random_state);
    return faults_strike(f, who, FAULT_HALF_MESSAGE, seconds) ? size / 2 : size;
}

// ---- what a person reads ------------------------------------------------------------------------

double faults_tell(const struct faults *f, double from_s, double to_s) {
    double next_s = INFINITY;
    for (int i = 0; i < f->count; i++) {
        const struct fault *fault = &f->list[i];
        const double times_s[] = {fault->at_s, fault->at_s + fault->for_s};
        for (int end = 0; end < 2; end++) {
            if (times_s[end] > to_s)
                next_s = fmin(next_s, times_s[end]);
            else if (times_s[end] > from_s)
                log_info("mockup", "fault %s (%s %s) %s", fault->name, who_names[fault->who],
                         what_names[fault->what], end ? "ends" : "begins");
        }
    }
    return next_s;
}
