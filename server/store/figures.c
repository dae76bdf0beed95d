// The figures of many sessions; for a trainee, averages of groups of them.
#include "base/check.h"
#include "store/courses.h"
#include "store/database.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define ROUNDING 10 // steps over the range

enum { METRIC, SUBJECT, VERSION, UNIT, VALUE, FIGURES_TRAINEE, CELLS };

// Those of one metric, subject, version and unit, which come one after the other.
struct gathered {
    store_row_handler take;
    void *user;
    char metric[STORE_NAME_MAX], subject[STORE_NAME_MAX], unit[STORE_NAME_MAX];
    int64_t version;
    struct gathered_figure {
        double value;
        int64_t trainee; // 0: nobody
    } * figures;
    size_t count, room;
};

static bool is_same_row(const struct gathered *g, const struct store_cell *cells) {
    return !strcmp(g->metric, cells[METRIC].text) && !strcmp(g->subject, cells[SUBJECT].text) &&
           g->version == cells[VERSION].integer && !strcmp(g->unit, cells[UNIT].text);
}

static void give(const struct gathered *g, double value) {
    const struct store_cell cells[] = {
        {.column = "metric", .kind = STORE_TEXT, .text = g->metric},
        {.column = "subject", .kind = STORE_TEXT, .text = g->subject},
        {.column = "version", .kind = STORE_INTEGER, .integer = g->version},
        {.column = "unit", .kind = STORE_TEXT, .text = g->unit},
        {.column = "value", .kind = STORE_REAL, .real = value},
    };
    g->take(g->user, cells, sizeof cells / sizeof *cells);
}

// Whether no figure in [from, at) is of the trainee of `at`.
static bool is_another(const struct gathered *g, size_t from, size_t at) {
    for (size_t i = from; i < at; i++)
        if (g->figures[i].trainee == g->figures[at].trainee)
            return false;
    return g->figures[at].trainee != 0;
}

// The end of the smallest group from here on with enough trainees; `count` + 1: there are too few.
static size_t end_of_group(const struct gathered *g, size_t from) {
    int trainees = 0;
    for (size_t i = from; i < g->count; i++) {
        trainees += is_another(g, from, i);
        if (trainees == STORE_TRAINEES_MIN)
            return i + 1;
    }
    return g->count + 1;
}

// 1, 2 or 5 times a power of ten.
static double round_step(double least) {
    double ten = pow(10, floor(log10(least)));
    double share = least / ten;
    return ten * (share <= 1 ? 1 : share <= 2 ? 2 : share <= 5 ? 5 : 10);
}

static double step_of(const struct gathered *g) {
    double range = g->figures[g->count - 1].value - g->figures[0].value;
    if (range <= 0)
        range = fabs(g->figures[0].value);
    return range > 0 ? round_step(range / ROUNDING) : 0;
}

static void give_means(const struct gathered *g) {
    double step = step_of(g);
    for (size_t from = 0, end; from < g->count; from = end) {
        end = end_of_group(g, from);
        if (end_of_group(g, end) > g->count) // what would be left are too few
            end = g->count;
        double mean = 0;
        for (size_t i = from; i < end; i++)
            mean += g->figures[i].value / (double)(end - from);
        for (size_t i = from; i < end; i++)
            give(g, step > 0 ? step * round(mean / step) : mean);
    }
}

static void finish(struct gathered *g) {
    if (g->count > 0)
        give_means(g);
    g->count = 0;
}

static void gather(void *user, const struct store_cell *cells, int count) {
    struct gathered *g = user;
    CHECK(count == CELLS);
    if (!is_same_row(g, cells)) {
        finish(g);
        snprintf(g->metric, sizeof g->metric, "%s", cells[METRIC].text);
        snprintf(g->subject, sizeof g->subject, "%s", cells[SUBJECT].text);
        snprintf(g->unit, sizeof g->unit, "%s", cells[UNIT].text);
        g->version = cells[VERSION].integer;
    }
    if (g->count == g->room) {
        g->room = 2 * g->room + 64;
        g->figures = alloc_resize(g->figures, g->room, sizeof *g->figures);
    }
    g->figures[g->count++] =
        (struct gathered_figure){cells[VALUE].real, cells[FIGURES_TRAINEE].integer};
}

#define FIGURES                                                                                    \
    "WITH figure AS (SELECT r.metric, r.subject, r.version, r.unit, r.value, s.trainee_id "        \
    "FROM result r JOIN session s ON s.id = r.session_id JOIN knee_case c ON c.id = s.case_id "    \
    "WHERE c.name = ?1 AND s.state = 'closed' AND r.value IS NOT NULL AND "                        \
    "(?2 IS NULL OR s.trainee_id IN (SELECT trainee_id FROM enrolment WHERE course_id = "          \
    "(SELECT id FROM course WHERE name = ?2)))) "

static enum result average(struct store *store, sqlite3_stmt *statement, store_row_handler take,
                           void *user, struct error *err) {
    struct gathered g = {.take = take, .user = user};
    enum result result = store_each_row(store, statement, gather, &g, err);
    if (result == RESULT_OK)
        finish(&g);
    free(g.figures);
    return result;
}

enum result store_figures_on(struct store *store, const char *case_name, const char *course,
                             bool hide_few, store_row_handler take, void *user, struct error *err) {
    static const char all[] =
        FIGURES "SELECT metric, subject, version, unit, value FROM figure ORDER BY 1, 2, 3, 4, 5";
    static const char of_many[] =
        FIGURES "SELECT metric, subject, version, unit, value, trainee_id FROM figure "
                "JOIN (SELECT metric, subject, version, unit FROM figure GROUP BY 1, 2, 3, 4 "
                "HAVING count(DISTINCT trainee_id) >= ?3) USING (metric, subject, version, unit) "
                "ORDER BY 1, 2, 3, 4, 5";
    sqlite3_stmt *statement;
    enum result result = hide_few
                             ? store_prepare(store, of_many, &statement, err, "tti", case_name,
                                             course, (int64_t)STORE_TRAINEES_MIN)
                             : store_prepare(store, all, &statement, err, "tt", case_name, course);
    if (result != RESULT_OK)
        return result;
    return hide_few ? average(store, statement, take, user, err)
                    : store_each_row(store, statement, take, user, err);
}

#define TIMES                                                                                      \
    "WITH attempted AS (SELECT a.time_s, a.end, s.trainee_id, row_number() OVER "                  \
    "(PARTITION BY s.trainee_id ORDER BY a.begun_utc_ns, a.id) AS number FROM attempt a "          \
    "JOIN session s ON s.id = a.session_id WHERE a.task = ?1 AND a.purpose = 'practice' AND "      \
    "s.trainee_id IS NOT NULL AND (?3 IS NULL OR a.hand = ?3) AND "                                \
    "(?2 IS NULL OR s.trainee_id IN (SELECT trainee_id FROM enrolment WHERE course_id = "          \
    "(SELECT id FROM course WHERE name = ?2)))), figure AS (SELECT 'time' AS metric, "             \
    "?1 AS subject, number AS version, 's' AS unit, time_s AS value, trainee_id FROM attempted "   \
    "WHERE end = 'done') "

enum result store_times_at(struct store *store, const char *task, const char *course,
                           const char *hand, bool hide_few, store_row_handler take, void *user,
                           struct error *err) {
    static const char all[] =
        TIMES "SELECT metric, subject, version, unit, value FROM figure ORDER BY 3, 5";
    static const char of_many[] =
        TIMES "SELECT metric, subject, version, unit, value, trainee_id FROM figure WHERE version "
              "IN (SELECT version FROM figure GROUP BY 1 HAVING count(DISTINCT trainee_id) >= ?4) "
              "ORDER BY 3, 5";
    sqlite3_stmt *statement;
    enum result result =
        hide_few ? store_prepare(store, of_many, &statement, err, "ttti", task, course, hand,
                                 (int64_t)STORE_TRAINEES_MIN)
                 : store_prepare(store, all, &statement, err, "ttt", task, course, hand);
    if (result != RESULT_OK)
        return result;
    return hide_few ? average(store, statement, take, user, err)
                    : store_each_row(store, statement, take, user, err);
}
