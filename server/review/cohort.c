#include "review/cohort.h"

#include "base/check.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { METRIC, SUBJECT, VERSION, UNIT, VALUE, CELLS };

static bool is_of(const struct spread *spread, const char *metric, const char *subject, int version,
                  const char *unit) {
    return !strcmp(spread->metric, metric) && !strcmp(spread->subject, subject) &&
           spread->version == version && !strcmp(spread->unit, unit);
}

static struct spread *begin_spread(struct cohort *c, const struct store_cell *cells) {
    if (c->count == c->room) {
        c->room = 2 * c->room + 64;
        c->spreads = alloc_resize(c->spreads, c->room, sizeof *c->spreads);
    }
    struct spread *spread = &c->spreads[c->count++];
    *spread = (struct spread){.version = (int)cells[VERSION].integer, .first = c->value_count};
    snprintf(spread->metric, sizeof spread->metric, "%s", cells[METRIC].text);
    snprintf(spread->subject, sizeof spread->subject, "%s", cells[SUBJECT].text);
    snprintf(spread->unit, sizeof spread->unit, "%s", cells[UNIT].text);
    return spread;
}

static void add_value(struct cohort *c, double value) {
    if (c->value_count == c->value_room) {
        c->value_room = 2 * c->value_room + 1024;
        c->values = alloc_resize(c->values, c->value_room, sizeof *c->values);
    }
    c->values[c->value_count++] = value;
}

// They come in order, so what belongs together is together.
static void take_figure(void *user, const struct store_cell *cells, int count) {
    struct cohort *c = user;
    CHECK(count == CELLS);
    if (cells[VALUE].kind != STORE_REAL || !isfinite(cells[VALUE].real))
        return;
    struct spread *last = c->count ? &c->spreads[c->count - 1] : NULL;
    if (!last || !is_of(last, cells[METRIC].text, cells[SUBJECT].text, (int)cells[VERSION].integer,
                        cells[UNIT].text))
        last = begin_spread(c, cells);
    add_value(c, cells[VALUE].real);
    last->count++;
}

static void count_row(void *user, const struct store_cell *cells, int count) {
    (void)cells, (void)count;
    ++*(int *)user;
}

enum result cohort_read(struct store *store, const char *case_name, const char *course,
                        bool hide_few, struct cohort *out, struct error *err) {
    int courses = 0;
    enum result result = RESULT_OK;
    *out = (struct cohort){0};
    if (course)
        result = store_rows(store, LIST_COURSES, course, count_row, &courses, err);
    if (result == RESULT_OK && course && !courses)
        result = fail(err, RESULT_MISSING, "there is no course '%.64s' in the records", course);
    return result == RESULT_OK
               ? store_figures_on(store, case_name, course, hide_few, take_figure, out, err)
               : result;
}

void cohort_fini(struct cohort *c) {
    free(c->spreads);
    free(c->values);
    *c = (struct cohort){0};
}

const struct spread *cohort_find(const struct cohort *c, const struct metric_kind *kind,
                                 const char *subject) {
    for (size_t i = 0; i < c->count; i++)
        if (is_of(&c->spreads[i], kind->name, subject, kind->version, kind->unit))
            return &c->spreads[i];
    return NULL;
}
