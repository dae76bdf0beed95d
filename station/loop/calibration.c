#include "loop/calibration.h"

#include "base/check.h"
#include "base/number.h"
#include "settings/settings.h"

#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#define DATE_FORMAT "%Y-%m-%dT%H:%M:%SZ"

static const char *const calibration_kind_names[CALIBRATION_KIND_COUNT] = {"tip", "registration",
                                                                           "encoder", "delay"};

bool calibration_is_angle(const struct calibration_entry *entry) {
    return entry->kind == CALIBRATION_ENCODER &&
           (!strcmp(entry->of, "flexion") || !strcmp(entry->of, "varus") ||
            !strcmp(entry->of, "internal"));
}

static struct calibration_entry *find(struct calibration *c, enum calibration_kind kind,
                                      const char *device, const char *of) {
    for (int i = 0; i < c->count; i++) {
        struct calibration_entry *entry = &c->entries[i];
        if (entry->kind == kind && !strcmp(entry->device, device) && !strcmp(entry->of, of))
            return entry;
    }
    return NULL;
}

bool calibration_put(struct calibration *c, const struct calibration_entry *entry) {
    struct calibration_entry *old = find(c, entry->kind, entry->device, entry->of);
    if (!old && c->count == CALIBRATION_ENTRIES_MAX)
        return false;
    *(old ? old : &c->entries[c->count++]) = *entry;
    return true;
}

struct calibration_summary calibration_summarise(const struct calibration *c) {
    CHECK(c->count > 0);
    struct calibration_summary summary = {.utc_s = INT64_MAX};
    for (int i = 0; i < c->count; i++) {
        const struct calibration_entry *entry = &c->entries[i];
        double *residual =
            calibration_is_angle(entry) ? &summary.residual_deg : &summary.residual_mm;
        if (entry->kind != CALIBRATION_DELAY)
            *residual = fmax(*residual, entry->residual);
        summary.utc_s = entry->utc_s < summary.utc_s ? entry->utc_s : summary.utc_s;
    }
    return summary;
}

// ---- reading ------------------------------------------------------------------------------------

// "DEVICE [OF]": a device's name may hold blanks, a channel and a key do not.
static bool split_name(const char *name, struct calibration_entry *out) {
    char copy[2 * CALIBRATION_NAME_MAX];
    if (!setting_text(name, copy, sizeof copy))
        return false;
    char *blank = strrchr(copy, ' ');
    if (out->kind == CALIBRATION_TIP || out->kind == CALIBRATION_ENCODER) {
        if (!blank || !setting_text(blank + 1, out->of, sizeof out->of))
            return false;
        *blank = '\0';
    }
    return setting_text(copy, out->device, sizeof out->device);
}

static void *entry_of(struct calibration *c, enum calibration_kind kind, const char *name,
                      struct error *err) {
    struct calibration_entry wanted = {.kind = kind};
    if (!split_name(name, &wanted)) {
        fail(err, RESULT_INVALID, "the name of the device, channel or key is too long or missing");
        return NULL;
    }
    if (!find(c, kind, wanted.device, wanted.of) && !calibration_put(c, &wanted)) {
        fail(err, RESULT_LIMIT, "more than %d parts", CALIBRATION_ENTRIES_MAX);
        return NULL;
    }
    return find(c, kind, wanted.device, wanted.of);
}

static void *find_tip(void *user, const char *name, struct error *err) {
    return entry_of(user, CALIBRATION_TIP, name, err);
}

static void *find_registration(void *user, const char *name, struct error *err) {
    return entry_of(user, CALIBRATION_REGISTRATION, name, err);
}

static void *find_encoder(void *user, const char *name, struct error *err) {
    return entry_of(user, CALIBRATION_ENCODER, name, err);
}

static void *find_delay(void *user, const char *name, struct error *err) {
    return entry_of(user, CALIBRATION_DELAY, name, err);
}

static bool take_date(void *target, const char *rest, const char *value) {
    (void)rest;
    struct tm utc = {0};
    const char *end = strptime(value, DATE_FORMAT, &utc);
    if (!end || *end)
        return false;
    ((struct calibration_entry *)target)->utc_s = timegm(&utc);
    return true;
}

static bool take_tip(void *target, const char *rest, const char *value) {
    (void)rest;
    pose p;
    if (!number_pose(value, &p))
        return false;
    ((struct calibration_entry *)target)->tip_mm = p.translation;
    return true;
}

static bool take_pose(void *target, const char *rest, const char *value) {
    (void)rest;
    return number_pose(value, &((struct calibration_entry *)target)->T_mockup_tracker);
}

#define IN_ENTRY(member) SETTING_IN(struct calibration_entry, member)
#define KEYS_OF_ALL                                                                                \
    {"date", .take = take_date, .wanted = "a time as 2026-11-21T08:30:00Z"},                       \
        {"residual", SETTING_NUMBER, IN_ENTRY(residual), 0, 1e6}, {                                \
        "details", SETTING_TEXT, IN_ENTRY(details)                                                 \
    }

static const struct setting_key tip_keys[] = {
    KEYS_OF_ALL, {"tip_mm", .take = take_tip, .wanted = "x y z in mm"}, {0}};
static const struct setting_key registration_keys[] = {
    KEYS_OF_ALL, {"T_mockup_tracker", .take = take_pose, .wanted = "x y z qw qx qy qz"}, {0}};
static const struct setting_key encoder_keys[] = {
    KEYS_OF_ALL,
    {"scale", SETTING_NUMBER, IN_ENTRY(scale), -1e9, 1e9},
    {"offset", SETTING_NUMBER, IN_ENTRY(offset), -1e9, 1e9},
    {0}};

static const struct setting_key delay_keys[] = {
    KEYS_OF_ALL, {"delay_ms", SETTING_NUMBER, IN_ENTRY(delay_ms), 0, 1000}, {0}};

static const struct setting_section calibration_sections[] = {
    {"tip DEVICE CHANNEL", tip_keys, find_tip},
    {"registration DEVICE", registration_keys, find_registration},
    {"encoder DEVICE KEY", encoder_keys, find_encoder},
    {"delay DEVICE", delay_keys, find_delay},
    {0}};

static bool is_complete(const struct calibration_entry *entry) {
    if (!entry->utc_s)
        return false;
    return entry->kind != CALIBRATION_REGISTRATION || pose_is_valid(entry->T_mockup_tracker);
}

enum result calibration_read(const char *path, struct calibration *out, struct error *err) {
    memset(out, 0, sizeof *out);
    enum result result = settings_load(path, NULL, 0, calibration_sections, out, err);
    for (int i = 0; i < out->count && result == RESULT_OK; i++)
        if (!is_complete(&out->entries[i]))
            result = fail(err, RESULT_MISSING, "%s: [%s %s%s%s] is not complete", path,
                          calibration_kind_names[out->entries[i].kind], out->entries[i].device,
                          out->entries[i].of[0] ? " " : "", out->entries[i].of);
    return result == RESULT_MISSING && !access(path, F_OK) ? RESULT_FORMAT : result;
}

// ---- writing ------------------------------------------------------------------------------------

static void write_entry(FILE *file, const struct calibration_entry *e) {
    char date[32];
    time_t seconds = (time_t)e->utc_s;
    struct tm utc;
    gmtime_r(&seconds, &utc);
    strftime(date, sizeof date, DATE_FORMAT, &utc);
    fprintf(file, "\n[%s %s%s%s]\ndate = %s\nresidual = %.4f\n", calibration_kind_names[e->kind],
            e->device, e->of[0] ? " " : "", e->of, date, e->residual);
    if (e->details[0])
        fprintf(file, "details = %s\n", e->details);
    const pose *p = &e->T_mockup_tracker;
    if (e->kind == CALIBRATION_TIP)
        fprintf(file, "tip_mm = %.4f %.4f %.4f\n", e->tip_mm.x, e->tip_mm.y, e->tip_mm.z);
    else if (e->kind == CALIBRATION_REGISTRATION)
        fprintf(file, "T_mockup_tracker = %.4f %.4f %.4f %.9f %.9f %.9f %.9f\n", p->translation.x,
                p->translation.y, p->translation.z, p->rotation.w, p->rotation.x, p->rotation.y,
                p->rotation.z);
    else if (e->kind == CALIBRATION_DELAY)
        fprintf(file, "delay_ms = %.2f\n", e->delay_ms);
    else
        fprintf(file, "scale = %.9g\noffset = %.9g\n", e->scale, e->offset);
}

static enum result open_part(const char *path, char part[PATH_MAX], FILE **out, struct error *err) {
    if (snprintf(part, PATH_MAX, "%s.part", path) >= PATH_MAX)
        return fail(err, RESULT_LIMIT, "%s: the path is too long", path);
    *out = fopen(part, "we");
    return *out ? RESULT_OK : fail(err, RESULT_IO, "%s: %s", part, strerror(errno));
}

enum result calibration_can_write(const char *path, struct error *err) {
    char part[PATH_MAX];
    FILE *file;
    enum result result = open_part(path, part, &file, err);
    if (result != RESULT_OK)
        return result;
    fclose(file);
    unlink(part);
    return RESULT_OK;
}

enum result calibration_write(const char *path, const struct calibration *c, struct error *err) {
    char part[PATH_MAX];
    FILE *file;
    enum result result = open_part(path, part, &file, err);
    if (result != RESULT_OK)
        return result;
    fputs("; Written by arthron-station calibrate.\n", file);
    for (int i = 0; i < c->count; i++)
        write_entry(file, &c->entries[i]);
    bool written = fflush(file) == 0 && fsync(fileno(file)) == 0;
    if (fclose(file) || !written || rename(part, path)) {
        fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
        unlink(part);
        return RESULT_IO;
    }
    return RESULT_OK;
}
