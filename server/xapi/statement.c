#include "xapi/statement.h"

#include "base/clock.h"

#include <string.h>

struct row {
    const struct store_cell *cells;
    int count;
};

static const struct store_cell *cell_of(struct row row, const char *column) {
    static const struct store_cell none = {.kind = STORE_NULL, .text = ""};
    for (int i = 0; i < row.count; i++)
        if (!strcmp(row.cells[i].column, column))
            return &row.cells[i];
    return &none;
}

static const char *text_of(struct row row, const char *column) {
    const struct store_cell *cell = cell_of(row, column);
    return cell->kind == STORE_TEXT ? cell->text : "";
}

static int64_t number_of(struct row row, const char *column) {
    return cell_of(row, column)->integer;
}

static bool has_statement(struct row row) {
    bool withheld =
        !strcmp(text_of(row, "purpose"), "exam") && strcmp(text_of(row, "exam_state"), "released");
    return text_of(row, "trainee")[0] && !withheld;
}

static json_t *actor(struct row row, const struct xapi_naming *naming) {
    char number[40];
    snprintf(number, sizeof number, "trainee-%lld", (long long)number_of(row, "trainee_number"));
    return xapi_actor(naming->site, naming->names ? text_of(row, "trainee") : number);
}

static json_t *object(struct row row, const char *site) {
    char iri[XAPI_IRI_MAX];
    xapi_iri(site, "tasks", text_of(row, "task"), iri);
    return json_pack("{s:s, s:s, s:{s:{s:s}, s:s}}", "objectType", "Activity", "id", iri,
                     "definition", "name", "en", text_of(row, "title"), "type",
                     XAPI_ACTIVITY_TYPE "simulation");
}

static json_t *score(struct row row) {
    double met = (double)number_of(row, "goals_met"), goals = (double)number_of(row, "goals");
    return json_pack("{s:f, s:f, s:i, s:f}", "scaled", met / goals, "raw", met, "min", 0, "max",
                     goals);
}

static bool is_complete(const char *end) {
    return strcmp(end, "left") != 0 && strcmp(end, "stopped") != 0;
}

static json_t *result(struct row row, const char *site) {
    char duration[32];
    xapi_duration(cell_of(row, "time_s")->real, duration);
    json_t *figures =
        json_pack("{s:s, s:I, s:I, s:I, s:b, s:f, s:I, s:I}", "end", text_of(row, "end"), "goals",
                  number_of(row, "goals"), "goals_met", number_of(row, "goals_met"), "errors",
                  number_of(row, "errors"), "sentinel", (int)number_of(row, "sentinel"),
                  "pass_time_s", cell_of(row, "pass_time_s")->real, "pass_errors",
                  number_of(row, "pass_errors"), "mark_version", number_of(row, "mark_version"));
    json_t *all =
        json_pack("{s:b, s:b, s:s, s:o}", "success", !strcmp(text_of(row, "verdict"), "passed"),
                  "completion", (int)is_complete(text_of(row, "end")), "duration", duration,
                  "extensions", xapi_extension(site, "attempt", figures));
    if (number_of(row, "goals") > 0)
        json_object_set_new(all, "score", score(row));
    return all;
}

static json_t *activities(const json_t *courses, const char *site) {
    json_t *list = json_array(), *course;
    char iri[XAPI_IRI_MAX];
    size_t i;
    json_array_foreach(courses, i, course) {
        xapi_iri(site, "courses", json_string_value(course), iri);
        json_array_append_new(list, json_pack("{s:s, s:s, s:{s:{s:O}, s:s}}", "objectType",
                                              "Activity", "id", iri, "definition", "name", "en",
                                              course, "type", XAPI_ACTIVITY_TYPE "course"));
    }
    return list;
}

static json_t *context(struct row row, const json_t *courses, const char *site) {
    char uuid[37];
    xapi_session_uuid(text_of(row, "session"), uuid);
    json_t *where = json_pack("{s:s, s:I, s:I, s:s, s:s, s:s, s:s, s:s, s:s}", "session",
                              text_of(row, "session"), "number", number_of(row, "number"),
                              "task_version", number_of(row, "task_version"), "task_hash",
                              text_of(row, "file_hash"), "case", text_of(row, "case"), "case_hash",
                              text_of(row, "case_hash"), "purpose", text_of(row, "purpose"), "hand",
                              text_of(row, "hand"), "station", text_of(row, "station"));
    json_t *all = json_pack("{s:s, s:s, s:o}", "registration", uuid, "platform",
                            "arthron-server " ARTHRON_VERSION, "extensions",
                            xapi_extension(site, "session", where));
    if (json_array_size(courses))
        json_object_set_new(all, "contextActivities",
                            json_pack("{s:o}", "grouping", activities(courses, site)));
    return all;
}

json_t *xapi_attempt(const struct store_cell *cells, int count, const json_t *courses,
                     const struct xapi_naming *naming) {
    struct row row = {cells, count};
    char uuid[37], when[32];
    if (!has_statement(row))
        return NULL;
    bool passed = !strcmp(text_of(row, "verdict"), "passed");
    double end_ns = cell_of(row, "time_s")->real * (double)NS_PER_S;
    xapi_attempt_uuid(text_of(row, "session"), (int)number_of(row, "number"), uuid);
    clock_utc_text(number_of(row, "begun_utc_ns") + (int64_t)end_ns, when);
    return json_pack("{s:s, s:o, s:o, s:o, s:o, s:o, s:s, s:s}", "id", uuid, "actor",
                     actor(row, naming), "verb", xapi_verb(passed ? "passed" : "failed"), "object",
                     object(row, naming->site), "result", result(row, naming->site), "context",
                     context(row, courses, naming->site), "timestamp", when, "version",
                     XAPI_VERSION);
}
