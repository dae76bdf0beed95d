// What a person writes: a first byte says which file it is. Configs, a recipe, a script of motions,
// a calibration, the verdict of a check, waiting poses, waiting audit entries.
#include "base/check.h"
#include "base/log.h"
#include "case/recorded_keys.h"
#include "check/grade.h"
#include "config/config.h"
#include "fuzz/fuzz.h"
#include "generate/generate.h"
#include "loop/config.h"
#include "motion/motion.h"
#include "records/audit_spool.h"

#include <stdio.h>
#include <string.h>

static void check_server_config(const struct server_config *config) {
    const struct sessions_config *s = &config->sessions;
    CHECK(s->port >= 1 && s->port <= 65535 && s->case_count <= SESSIONS_CASES_MAX);
    for (int i = 0; i < s->station_count; i++)
        CHECK(sessions_find_case(s, s->stations[i].case_name) >= 0);
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        CHECK(instrument_body_is_valid(&s->settings.bodies[i]));
}

static void server_config(const char *path) {
    static struct server_config config;
    if (config_load(path, NULL, 0, &config, NULL) == RESULT_OK)
        check_server_config(&config);
    config_fini(&config);
}

static void station_config(const char *path) {
    struct station_config *config = NULL;
    if (station_config_load(path, NULL, 0, &config, NULL) == RESULT_OK) {
        CHECK(config->rate_hz >= 1 && config->device_count <= STATION_DEVICES_MAX);
        station_config_calibrate(config, NULL);
    }
    station_config_destroy(&config);
}

static void recipe(const char *path) {
    static struct recipe recipe;
    if (recipe_load(path, &recipe, NULL) == RESULT_OK)
        CHECK(case_name_is_valid(recipe.name));
}

static void script(const char *path) {
    static struct motion_script script;
    motion_script_load(path, &script, NULL);
}

static void calibration(const char *path) {
    static struct calibration read, again;
    if (calibration_read(path, &read, NULL) != RESULT_OK)
        return;
    CHECK(calibration_write(path, &read, NULL) == RESULT_OK);
    CHECK(calibration_read(path, &again, NULL) == RESULT_OK);
    CHECK(again.count == read.count);
}

static void verdict(const char *path) {
    static struct case_grade grade;
    (void)path;
    if (grade_read(fuzz_folder(), &grade, NULL) == RESULT_OK)
        CHECK(strlen(grade_name(grade.grade)) > 0);
}

static void waiting_poses(const char *path) {
    static struct recorded_keys record;
    (void)path;
    if (recorded_keys_load(fuzz_folder(), &record, NULL) != RESULT_OK)
        return;
    CHECK(record.count >= 0 && record.count <= CASE_KEYS_MAX);
    for (int i = 0; i < record.count; i++)
        CHECK(case_name_is_valid(record.waiting[i].ligament) &&
              pose_is_valid(record.waiting[i].physical));
}

static void look(void *user, const struct store_audit_entry *entry) {
    CHECK(memchr(entry->actor, 0, sizeof entry->actor) &&
          memchr(entry->action, 0, sizeof entry->action) &&
          memchr(entry->subject, 0, sizeof entry->subject));
    ++*(size_t *)user;
}

static void waiting_entries(const char *path) {
    char records[320];
    size_t looked = 0;
    snprintf(records, sizeof records, "%.*s", (int)(strrchr(path, '.') - path), path);
    size_t count;
    CHECK(audit_spool_read(records, look, &looked, &count, NULL) == RESULT_OK && count == looked);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static const struct {
        const char *name;
        void (*read)(const char *path);
    } kinds[] = {
        {"server.ini", server_config},    {"station.ini", station_config},
        {"recipe.ini", recipe},           {"script.ini", script},
        {"calibration.ini", calibration}, {"check.json", verdict},
        {"recorded.json", waiting_poses}, {"records.arrears", waiting_entries},
    };
    if (!size || data[0] < 'a' || data[0] >= 'a' + sizeof kinds / sizeof *kinds)
        return 0;
    log_set_level(LOG_ERROR);
    kinds[data[0] - 'a'].read(fuzz_file(kinds[data[0] - 'a'].name, data + 1, size - 1));
    return 0;
}
