#include "sessions/grades.h"

#include "base/check.h"
#include "base/log.h"
#include "check/standing.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

struct grades {
    const struct sessions_config *config;
    pthread_mutex_t refreshing; // held over files; before `lock`
    pthread_mutex_t lock;       // of the standings; never held over a file
    uint64_t hashes[SESSIONS_CASES_MAX];
    struct case_standing standings[SESSIONS_CASES_MAX];
    struct error refused[SESSIONS_CASES_MAX]; // why a case could not be read; empty: it was
};

static void log_grade(const struct sessions_config *config, const char *name,
                      const struct case_grade *grade) {
    const char *field = field_name(config->settings.field.kind);
    if (strcmp(grade->field, field) != 0)
        log_warning("sessions", "case %s was checked with the field %s and is served with %s", name,
                    grade->field, field);
    if (grade->grade == GRADE_UNFIT)
        log_warning("sessions", "case %s is unfit, %s: %s", name,
                    config->serve_unfit ? "and is served because of unfit = serve"
                                        : "so no session opens on it",
                    grade->reason);
    else
        log_info("sessions", "case %s is %s%s", name, grade_name(grade->grade),
                 grade->quick ? " by a quick check" : "");
}

static void log_standing(const struct sessions_config *config, int index,
                         const struct case_standing *s) {
    const struct session_case *entry = &config->cases[index];
    switch (s->kind) {
    case STANDING_UNCHECKED:
        log_warning("sessions", "case %s is not checked: run arthron-case check %s", entry->name,
                    entry->dir);
        break;
    case STANDING_UNREADABLE:
        log_warning("sessions", "case %s: its check cannot be read: %s", entry->name,
                    s->problem.text);
        break;
    case STANDING_OUTDATED:
        log_warning(
            "sessions",
            "case %s: its check is of other files. Check it again (arthron-case check %s), or "
            "restart the server if the case has changed",
            entry->name, entry->dir);
        break;
    case STANDING_FOREIGN:
        log_warning("sessions",
                    "case %s: its check was made elsewhere and does not count: run arthron-case "
                    "check %s",
                    entry->name, entry->dir);
        break;
    case STANDING_GRADED:
        log_grade(config, entry->name, &s->grade);
        break;
    }
}

struct grades *grades_create(const struct sessions_config *config, const uint64_t hashes[],
                             const struct error refused[]) {
    struct grades *g = alloc(1, sizeof *g);
    g->config = config;
    pthread_mutex_init(&g->refreshing, NULL);
    pthread_mutex_init(&g->lock, NULL);
    memcpy(g->hashes, hashes, (size_t)config->case_count * sizeof *hashes);
    memcpy(g->refused, refused, (size_t)config->case_count * sizeof *refused);
    grades_refresh(g);
    return g;
}

void grades_destroy(struct grades **grades) {
    if (!*grades)
        return;
    pthread_mutex_destroy(&(*grades)->lock);
    pthread_mutex_destroy(&(*grades)->refreshing);
    free(*grades);
    *grades = NULL;
}

void grades_refresh(struct grades *grades) {
    pthread_mutex_lock(&grades->refreshing);
    for (int i = 0; i < grades->config->case_count; i++) {
        struct case_standing standing = grades->standings[i];
        if (grades->refused[i].text[0] ||
            !standing_refresh(&standing, grades->config->cases[i].dir, grades->hashes[i]))
            continue;
        log_standing(grades->config, i, &standing);
        pthread_mutex_lock(&grades->lock);
        grades->standings[i] = standing;
        pthread_mutex_unlock(&grades->lock);
    }
    pthread_mutex_unlock(&grades->refreshing);
}

const char *grades_name(struct grades *grades, int index) {
    if (grades->refused[index].text[0])
        return "broken";
    pthread_mutex_lock(&grades->lock);
    const char *name = standing_name(&grades->standings[index]);
    pthread_mutex_unlock(&grades->lock);
    return name;
}

bool grades_are_broken(const struct grades *grades, int index, struct error *why) {
    *why = grades->refused[index];
    return why->text[0];
}

enum result grades_allow(struct grades *grades, int index, struct error *err) {
    enum result result = RESULT_OK;
    if (grades->refused[index].text[0])
        return fail(err, RESULT_REFUSED, "%s", grades->refused[index].text);
    pthread_mutex_lock(&grades->lock);
    const struct case_standing *s = &grades->standings[index];
    if (s->kind == STANDING_GRADED && s->grade.grade == GRADE_UNFIT && !grades->config->serve_unfit)
        result = fail(err, RESULT_REFUSED, "case %s is unfit: %s",
                      grades->config->cases[index].name, s->grade.reason);
    pthread_mutex_unlock(&grades->lock);
    return result;
}
