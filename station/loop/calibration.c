#include "loop/calibration.h"

#include "base/check.h"
#include "base/number.h"
#include "settings/settings.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#define DATE_FORMAT "%Y-%m-%dT%H:%M:%SZ"

static const char *const kind_names[CALIBRATION_KIND_COUNT] = {"tip", "registration", "encoder"};

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
        *residual = fmax(*residual, entry->residual);
        summary.utc_s = entry->utc_s < summary.utc_s ? entry->utc_s : summary.utc_s;
    }
    return summary;
}

// ---- reading ------------------------------------------------------------------------------------

// "KIND DEVICE [OF]": a device's name may hold blanks, a channel and a key do not.
static struct calibration_entry *section_entry(struct calibration *c, const char *section) {
    struct calibration_entry wanted = {.kind = 0};
    while (wanted.kind < CALIBRATION_KIND_COUNT &&
           (strncmp(section, kind_names[wanted.kind], strlen(kind_names[wanted.kind])) ||
            section[strlen(kind_names[wanted.kind])] != ' '))
        wanted.kind++;
    if (wanted.kind == CALIBRATION_KIND_COUNT)
        return NULL;
    char rest[2 * CALIBRATION_NAME_MAX];
    if (!setting_text(section + strlen(kind_names[wanted.kind]) + 1, rest, sizeof rest))
        return NULL;
    char *blank = strrchr(rest, ' ');
    if (wanted.kind != CALIBRATION_REGISTRATION) {
        if (!blank || !setting_text(blank + 1, wanted.of, sizeof wanted.of))
            return NULL;
        *blank = '\0';
    }
    if (!setting_text(rest, wanted.device, sizeof wanted.device))
        return NULL;
    if (!find(c, wanted.kind, wanted.device, wanted.of) && !calibration_put(c, &wanted))
        return NULL;
    return find(c, wanted.kind, wanted.device, wanted.of);
}

static bool take_date(const char *value, int64_t *out_utc_s) {
    struct tm utc = {0};
    const char *end = strptime(value, DATE_FORMAT, &utc);
    if (!end || *end)
        return false;
    *out_utc_s = timegm(&utc);
    return true;
}

static bool take_value(struct calibration_entry *entry, const char *key, const char *value) {
    pose p;
    switch (entry->kind) {
    case CALIBRATION_TIP:
        if (strcmp(key, "tip_mm") || !number_pose(value, &p))
            return false;
        entry->tip_mm = p.translation;
        return true;
    case CALIBRATION_REGISTRATION:
        return !strcmp(key, "T_mockup_tracker") && number_pose(value, &entry->T_mockup_tracker);
    default:
        if (!strcmp(key, "scale"))
            return number_double(value, -1e9, 1e9, &entry->scale);
        return !strcmp(key, "offset") && number_double(value, -1e9, 1e9, &entry->offset);
    }
}

static bool take_key(void *user, const char *section, const char *key, const char *value) {
    struct calibration_entry *entry = section_entry(user, section);
    if (!entry)
        return false;
    if (!strcmp(key, "date"))
        return take_date(value, &entry->utc_s);
    if (!strcmp(key, "residual"))
        return number_double(value, 0, 1e6, &entry->residual);
    if (!strcmp(key, "details"))
        return setting_text(value, entry->details, sizeof entry->details);
    return take_value(entry, key, value);
}

static bool is_complete(const struct calibration_entry *entry) {
    if (!entry->utc_s)
        return false;
    return entry->kind != CALIBRATION_REGISTRATION || pose_is_valid(entry->T_mockup_tracker);
}

enum result calibration_read(const char *path, struct calibration *out, struct error *err) {
    memset(out, 0, sizeof *out);
    enum result result = settings_read(path, NULL, 0, take_key, out, err);
    for (int i = 0; i < out->count && result == RESULT_OK; i++)
        if (!is_complete(&out->entries[i]))
            result = fail(err, RESULT_MISSING, "%s: [%s %s%s%s] is not complete", path,
                          kind_names[out->entries[i].kind], out->entries[i].device,
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
    fprintf(file, "\n[%s %s%s%s]\ndate = %s\nresidual = %.4f\n", kind_names[e->kind], e->device,
            e->of[0] ? " " : "", e->of, date, e->residual);
    if (e->details[0])
        fprintf(file, "details = %s\n", e->details);
    const pose *p = &e->T_mockup_tracker;
    if (e->kind == CALIBRATION_TIP)
        fprintf(file, "tip_mm = %.4f %.4f %.4f\n", e->tip_mm.x, e->tip_mm.y, e->tip_mm.z);
    else if (e->kind == CALIBRATION_REGISTRATION)
        fprintf(file, "T_mockup_tracker = %.4f %.4f %.4f %.9f %.9f %.9f %.9f\n", p->translation.x,
                p->translation.y, p->translation.z, p->rotation.w, p->rotation.x, p->rotation.y,
                p->rotation.z);
    else
        fprintf(file, "scale = %.9g\noffset = %.9g\n", e->scale, e->offset);
}

enum result calibration_write(const char *path, const struct calibration *c, struct error *err) {
    char part[4096];
    if ((size_t)snprintf(part, sizeof part, "%s.part", path) >= sizeof part)
        return fail(err, RESULT_LIMIT, "%s: the path is too long", path);
    FILE *file = fopen(part, "we");
    if (!file)
        return fail(err, RESULT_IO, "%s: %s", part, strerror(errno));
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
