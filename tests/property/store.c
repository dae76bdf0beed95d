// Random histories of a training centre, in the records and in a plain model of them: they tell the
// same at any time, across reopening, backups and restores.
#include "test.h"
#include "unit/store_files.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define NAMES 6
#define SESSIONS 12
#define METRICS 3
#define STEPS 220
#define HISTORIES 8

// What the records must say. People in the order in which they came, gone ones too.
struct model {
    struct {
        char name[STORE_NAME_MAX]; // the pseudonym once erased
        char full_name[32];
        bool erased, in_course[NAMES];
    } people[NAMES * STEPS];
    int person_count;
    char courses[NAMES][8];
    int course_count;
    struct {
        bool there;
        int person; // -1: nobody
        enum store_state state;
        uint64_t steps;
        bool hashed, has_result[METRICS];
        double results[METRICS];
    } sessions[SESSIONS];
    int order[SESSIONS], session_count; // as they came
};

static struct model model, at_backup;
static uint64_t chance;
static struct error err;

static unsigned any(unsigned below) {
    chance ^= chance << 13, chance ^= chance >> 7, chance ^= chance << 17;
    return (unsigned)((chance >> 11) % below);
}

static int person_named(const char *name) {
    for (int i = 0; i < model.person_count; i++)
        if (!strcmp(model.people[i].name, name))
            return i;
    return -1;
}

static int make_person(const char *name, const char *full_name) {
    int i = model.person_count++;
    memset(&model.people[i], 0, sizeof model.people[i]);
    snprintf(model.people[i].name, STORE_NAME_MAX, "%s", name);
    snprintf(model.people[i].full_name, sizeof model.people[i].full_name, "%s", full_name);
    return i;
}

static int course_named(const char *name) {
    for (int i = 0; i < model.course_count; i++)
        if (!strcmp(model.courses[i], name))
            return i;
    return -1;
}

// ---- what happens -------------------------------------------------------------------------------

static void add_trainee(struct store *store, const char *name) {
    bool named = any(2);
    enum result expected = person_named(name) < 0 ? RESULT_OK : RESULT_REFUSED;
    assert_int_equal(store_add_trainee(store, name, named ? "Full Name" : NULL, &err), expected);
    if (expected == RESULT_OK)
        make_person(name, named ? "Full Name" : "");
}

static void add_course(struct store *store, const char *name) {
    enum result expected = course_named(name) < 0 ? RESULT_OK : RESULT_REFUSED;
    assert_int_equal(store_add_course(store, name, &err), expected);
    if (expected == RESULT_OK)
        snprintf(model.courses[model.course_count++], sizeof model.courses[0], "%s", name);
}

static void enrol(struct store *store, const char *name, const char *course) {
    int person = person_named(name), place = course_named(course);
    enum result expected = person < 0 || place < 0 ? RESULT_MISSING : RESULT_OK;
    assert_int_equal(store_enrol(store, name, course, &err), expected);
    if (expected == RESULT_OK)
        model.people[person].in_course[place] = true;
}

static void erase(struct store *store, const char *name) {
    char pseudonym[STORE_NAME_MAX];
    int person = person_named(name);
    enum result expected = person < 0 ? RESULT_MISSING : RESULT_OK;
    assert_int_equal(store_erase_trainee(store, name, pseudonym, &err), expected);
    if (expected != RESULT_OK)
        return;
    snprintf(model.people[person].name, STORE_NAME_MAX, "%s", pseudonym);
    model.people[person].full_name[0] = '\0';
    model.people[person].erased = true;
    memset(model.people[person].in_course, 0, sizeof model.people[person].in_course);
}

static void begin_in_model(int number, const char *name) {
    int person = name[0] ? person_named(name) : -1;
    if (name[0] && person < 0)
        person = make_person(name, "");
    model.sessions[number].person = person;
    model.sessions[number].there = true;
    model.order[model.session_count++] = number;
}

// A put names the trainee anew each time, as one that waited since before an erasure would.
static void put_session(struct store *store, int number, const char *name) {
    struct store_session session = a_session((unsigned)number);
    struct store_result result = {.subject = "x", .version = 1, .unit = "mm"};
    int metric = (int)any(METRICS), count = (int)any(2);
    snprintf(session.trainee, sizeof session.trainee, "%s", name);
    session.state = (enum store_state)any(4);
    session.steps = any(1000);
    session.trace_is_read = any(2);
    snprintf(result.metric, sizeof result.metric, "metric-%d", metric);
    result.value = any(5) ? any(1000) / 7.0 : NAN;
    assert_int_equal(store_put_session(store, &session, &result, count, &err), RESULT_OK);
    if (!model.sessions[number].there)
        begin_in_model(number, name);
    if (model.sessions[number].state != STATE_DESERTED)
        model.sessions[number].state = session.state;
    model.sessions[number].steps = session.steps;
    model.sessions[number].hashed = session.trace_is_read;
    if (count) {
        model.sessions[number].has_result[metric] = true;
        model.sessions[number].results[metric] = result.value;
    }
}

static void interrupt(struct store *store, int before) {
    int64_t time_ns = a_session((unsigned)before).start_utc_ns;
    assert_int_equal(store_interrupt_open(store, time_ns, &err), RESULT_OK);
    for (int i = 0; i < before; i++)
        if (model.sessions[i].there && model.sessions[i].state == STATE_OPEN)
            model.sessions[i].state = STATE_INTERRUPTED;
}

// ---- what must be there -------------------------------------------------------------------------

static char expected[1 << 20];
static size_t used;

__attribute__((format(printf, 1, 2))) static void expect(const char *format, ...) {
    va_list args;
    va_start(args, format);
    used += (size_t)vsnprintf(expected + used, sizeof expected - used, format, args);
    va_end(args);
    assert_true(used < sizeof expected);
}

static void begin_expecting(void) {
    used = 0;
    expected[0] = '\0';
}

// Without the columns of times, which nobody knows before.
static const char *without_times(const char *rows) {
    static char kept[1 << 20];
    char *out = kept;
    while (*rows) {
        size_t length = strcspn(rows, "|\n");
        const char *equals = memchr(rows, '=', length);
        bool is_time = equals - rows > 7 && !memcmp(equals - 7, "_utc_ns", 7);
        if (!is_time) {
            memcpy(out, rows, length + 1);
            out += length + 1;
        }
        rows += length + 1;
    }
    *out = '\0';
    return kept;
}

static void people_are_told(struct store *store) {
    begin_expecting();
    for (int i = 0; i < model.person_count; i++) {
        int sessions = 0;
        for (int k = 0; k < SESSIONS; k++)
            sessions += model.sessions[k].there && model.sessions[k].person == i;
        expect("name=%s|full_name=%s|sessions=%d\n", model.people[i].name,
               model.people[i].full_name, sessions);
    }
    assert_string_equal(without_times(rows_of(store, LIST_TRAINEES, NULL)), expected);
    begin_expecting();
    for (int c = 0; c < model.course_count; c++)
        for (int i = 0; i < model.person_count; i++)
            if (model.people[i].in_course[c])
                expect("course=%s|trainee=%s\n", model.courses[c], model.people[i].name);
    assert_string_equal(rows_of(store, LIST_ENROLMENTS, NULL), expected);
}

static void sessions_are_told(struct store *store) {
    static const char *const states[] = {"open", "closed", "deserted", "interrupted"};
    begin_expecting();
    for (int i = 0; i < model.session_count; i++) {
        int n = model.order[i], person = model.sessions[n].person;
        expect("id=%032x|station=room-1|trainee=%s|case=tear-radial|case_hash=000000001234abcd|"
               "state=%s|steps=%" PRIu64 "|missing=0|trace=/traces/%d.trace|trace_xxh3=%s|"
               "trace_hash=|part=1|server=\n",
               (unsigned)n, person < 0 ? "" : model.people[person].name,
               states[model.sessions[n].state], model.sessions[n].steps, n,
               model.sessions[n].hashed ? "0000000000000000" : "");
    }
    assert_string_equal(without_times(rows_of(store, LIST_SESSIONS, NULL)), expected);
    begin_expecting();
    for (int i = 0; i < model.session_count; i++)
        for (int m = 0; m < METRICS; m++) {
            int n = model.order[i];
            char value[32] = "";
            if (isfinite(model.sessions[n].results[m]))
                snprintf(value, sizeof value, "%.17g", model.sessions[n].results[m]);
            if (model.sessions[n].has_result[m])
                expect("session=%032x|metric=metric-%d|subject=x|version=1|unit=mm|value=%s|"
                       "details=\n",
                       (unsigned)n, m, value);
        }
    assert_string_equal(rows_of(store, LIST_RESULTS, NULL), expected);
}

// ---- histories ----------------------------------------------------------------------------------

static void put_back(struct store **store) {
    char aside[STORE_TEXT_MAX];
    if (access(in_folder("backup.db"), F_OK))
        return;
    store_close(store);
    assert_int_equal(store_restore(in_folder("backup.db"), store_path, "tester", aside, &err),
                     RESULT_OK);
    *store = open_records();
    model = at_backup;
}

static void back_up(struct store *store) {
    unlink(in_folder("backup.db"));
    assert_int_equal(store_backup(store, in_folder("backup.db"), &err), RESULT_OK);
    at_backup = model;
}

static void do_anything(struct store **store) {
    static const char *const names[NAMES] = {"ada", "grace", "émilie", "o'brien", "a b", "\"q\""};
    static const char *const courses[] = {"spring", "autumn", "x"};
    const char *name = names[any(NAMES)], *course = courses[any(3)];
    unsigned what = any(100);
    if (what < 15)
        add_trainee(*store, name);
    else if (what < 20)
        add_course(*store, course);
    else if (what < 35)
        enrol(*store, name, course);
    else if (what < 45)
        erase(*store, name);
    else if (what < 85)
        put_session(*store, (int)any(SESSIONS), any(5) ? name : "");
    else if (what < 89)
        interrupt(*store, (int)any(SESSIONS));
    else if (what < 93)
        back_up(*store);
    else if (what < 95)
        put_back(store);
    else {
        store_close(store);
        *store = open_records();
    }
}

static void records_and_model_tell_the_same(void **state) {
    (void)state;
    for (int history = 0; history < HISTORIES; history++) {
        unlink(in_folder("backup.db"));
        unlink(store_path);
        memset(&model, 0, sizeof model);
        chance = 0x9e3779b97f4a7c15u * (unsigned)(history + 1);
        struct store *store = open_records();
        for (int i = 0; i < STEPS; i++) {
            do_anything(&store);
            people_are_told(store);
            sessions_are_told(store);
        }
        store_close(&store);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(records_and_model_tell_the_same, store_folder_begin,
                                        store_folder_end),
    };
    return cmocka_run_group_tests_name("store_model", tests, NULL, NULL);
}
