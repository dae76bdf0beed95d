#include "faults.h"

#include "base/log.h"
#include "base/number.h"
#include "settings/settings.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#define OF(who) (1u << (who))
#define EVERYONE (OF(FAULT_MODBUS) | OF(FAULT_TRACKER) | OF(FAULT_HID))

static const char *const who_names[FAULT_WHO_COUNT] = {"modbus", "tracker", "hid"};

static const struct kind {
    const char *name;
    unsigned whose;
    bool has_value;
} kinds[FAULT_WHAT_COUNT] = {
    [FAULT_DROPOUT] = {"dropout", EVERYONE, false},
    [FAULT_FREEZE] = {"freeze", EVERYONE, false},
    [FAULT_JUMP] = {"jump", EVERYONE, true},
    [FAULT_NOISE] = {"noise", EVERYONE, true},
    [FAULT_NAN] = {"nan", OF(FAULT_MODBUS) | OF(FAULT_TRACKER), false},
    [FAULT_LATE] = {"late", EVERYONE, true},
    [FAULT_STALE] = {"stale", EVERYONE, true},
    [FAULT_JUNK] = {"junk", EVERYONE, false},
    [FAULT_WRONG_SLAVE] = {"wrong-slave", OF(FAULT_MODBUS), false},
    [FAULT_UNPLUG] = {"unplug", EVERYONE, false},
    [FAULT_CLOCK_STEP] = {"clock-step", OF(FAULT_TRACKER), true},
    [FAULT_CLOCK_DRIFT] = {"clock-drift", OF(FAULT_TRACKER), true},
    [FAULT_NEWER_VERSION] = {"newer-version", OF(FAULT_MODBUS) | OF(FAULT_TRACKER), false},
    [FAULT_HALF_MESSAGE] = {"half-message", EVERYONE, false},
};

// ---- the file -----------------------------------------------------------------------------------

static struct fault *fault_named(struct faults *f, const char *name) {
    for (int i = 0; i < f->count; i++)
        if (!strcmp(f->list[i].name, name))
            return &f->list[i];
    if (f->count == FAULTS_MAX || !setting_text(name, f->list[f->count].name, FAULT_NAME_MAX))
        return NULL;
    struct fault *fault = &f->list[f->count++];
    fault->who = FAULT_WHO_COUNT;
    fault->what = FAULT_WHAT_COUNT;
    fault->at_s = fault->for_s = fault->value = NAN;
    fault->every = 1;
    return fault;
}

static bool take_who(const char *value, struct fault *fault) {
    for (int i = 0; i < FAULT_WHO_COUNT; i++)
        if (!strcmp(value, who_names[i])) {
            fault->who = (enum fault_who)i;
            return true;
        }
    return false;
}

static bool take_what(const char *value, struct fault *fault) {
    for (int i = 0; i < FAULT_WHAT_COUNT; i++)
        if (!strcmp(value, kinds[i].name)) {
            fault->what = (enum fault_what)i;
            return true;
        }
    return false;
}

static bool take_every(const char *value, struct fault *fault) {
    int64_t every;
    if (!number_int(value, 1, 1000000, &every))
        return false;
    fault->every = (int)every;
    return true;
}

static bool take_key(void *user, const char *section, const char *key, const char *value) {
    struct fault *fault =
        strncmp(section, "fault ", 6) ? NULL : fault_named((struct faults *)user, section + 6);
    if (!fault)
        return false;
    if (!strcmp(key, "at_s"))
        return number_double(value, 0, 1e6, &fault->at_s);
    if (!strcmp(key, "for_s"))
        return number_double(value, 0, 1e6, &fault->for_s);
    if (!strcmp(key, "value"))
        return number_double(value, -1e6, 1e6, &fault->value);
    if (!strcmp(key, "who"))
        return take_who(value, fault);
    if (!strcmp(key, "what"))
        return take_what(value, fault);
    if (!strcmp(key, "every"))
        return take_every(value, fault);
    return false;
}

static enum result check(const struct fault *f, struct error *err) {
    if (f->who == FAULT_WHO_COUNT || f->what == FAULT_WHAT_COUNT || isnan(f->at_s) ||
        isnan(f->for_s))
        return fail(err, RESULT_MISSING, "[fault %s]: needs at_s, for_s, who and what", f->name);
    const struct kind *kind = &kinds[f->what];
    if (!(kind->whose & OF(f->who)))
        return fail(err, RESULT_INVALID, "[fault %s] what: %s has no %s", f->name,
                    who_names[f->who], kind->name);
    if (kind->has_value == isnan(f->value))
        return fail(err, kind->has_value ? RESULT_MISSING : RESULT_INVALID,
                    "[fault %s] value: %s %s value", f->name, kind->name,
                    kind->has_value ? "needs a" : "takes no");
    bool is_time = f->what == FAULT_LATE || f->what == FAULT_STALE;
    if (is_time && (f->value < 0 || f->value > 10000))
        return fail(err, RESULT_INVALID, "[fault %s] value: 0 to 10000 ms", f->name);
    return RESULT_OK;
}

enum result faults_read(const char *path, struct faults *out, struct error *err) {
    enum result result = settings_read(path, NULL, 0, take_key, out, err);
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
                         kinds[fault->what].name, end ? "ends" : "begins");
        }
    }
    return next_s;
}
