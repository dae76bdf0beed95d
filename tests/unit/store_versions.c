// Records that older programs made, as text: a new program brings them to its own tables, all rows
// as they were, and lands at the same tables as if it had made the file.
#include "base/check.h"
#include "test.h"
#include "unit/store_files.h"

#include <pthread.h>
#include <sqlite3.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

// Version 1, as its program wrote it. Never changed.
static const char version_1[] =
    "PRAGMA application_id = 0x4172746e; PRAGMA user_version = 1;"
    "CREATE TABLE trainee (  id INTEGER PRIMARY KEY,  name TEXT NOT NULL UNIQUE,"
    "  full_name TEXT,  created_utc_ns INTEGER NOT NULL,  erased_utc_ns INTEGER) STRICT;"
    "CREATE TABLE course (  id INTEGER PRIMARY KEY,  name TEXT NOT NULL UNIQUE,"
    "  created_utc_ns INTEGER NOT NULL) STRICT;"
    "CREATE TABLE enrolment (  trainee_id INTEGER NOT NULL REFERENCES trainee,"
    "  course_id INTEGER NOT NULL REFERENCES course,  PRIMARY KEY (trainee_id, course_id)) STRICT;"
    "CREATE TABLE station (  id INTEGER PRIMARY KEY,  name TEXT NOT NULL UNIQUE) STRICT;"
    "CREATE TABLE knee_case (  id INTEGER PRIMARY KEY,  name TEXT NOT NULL,  hash TEXT NOT NULL,"
    "  UNIQUE (name, hash)) STRICT;"
    "CREATE TABLE session (  id INTEGER PRIMARY KEY,"
    "  uuid TEXT NOT NULL UNIQUE CHECK (length(uuid) = 32),"
    "  station_id INTEGER NOT NULL REFERENCES station,  trainee_id INTEGER REFERENCES trainee,"
    "  case_id INTEGER NOT NULL REFERENCES knee_case,  start_utc_ns INTEGER NOT NULL,"
    "  end_utc_ns INTEGER,"
    "  state TEXT NOT NULL CHECK (state IN ('open', 'closed', 'deserted', 'interrupted')),"
    "  steps INTEGER NOT NULL,  missing INTEGER NOT NULL,  trace TEXT NOT NULL,"
    "  trace_xxh3 TEXT) STRICT;"
    "CREATE INDEX session_trainee ON session (trainee_id);"
    "CREATE INDEX session_trace ON session (trace);"
    "CREATE TABLE result (  session_id INTEGER NOT NULL REFERENCES session,"
    "  metric TEXT NOT NULL,  subject TEXT NOT NULL,  version INTEGER NOT NULL,"
    "  unit TEXT NOT NULL,  value REAL,  details TEXT,"
    "  PRIMARY KEY (session_id, metric, subject, version)) STRICT;"
    "INSERT INTO trainee VALUES (7, 'ada', 'Ada Lovelace', 111, NULL), (9, 'erased-1', NULL, 5, 6);"
    "INSERT INTO course VALUES (1, 'autumn', 222);"
    "INSERT INTO enrolment VALUES (7, 1);"
    "INSERT INTO station VALUES (3, 'room-1');"
    "INSERT INTO knee_case VALUES (4, 'tear-radial', '00000000000000ff');"
    "INSERT INTO session VALUES (1, '0123456789abcdef0123456789abcdef', 3, 7, 4, 1000, 2000, "
    "'closed', 12, 1, '/t/1.trace', '1111111111111111'),"
    "(2, '1123456789abcdef0123456789abcdef', 3, NULL, 4, 3000, NULL, 'open', 0, 0, '/t/2.trace', "
    "NULL);"
    "INSERT INTO result VALUES (1, 'over', 'meniscus_medial', 1, 'mm3', 4.5, NULL),"
    "(1, 'rim', 'meniscus_medial', 1, 'mm', NULL, '{}');";

// Version 2: what it had beside that.
static const char version_2[] =
    "PRAGMA user_version = 2;"
    "CREATE TABLE account (  id INTEGER PRIMARY KEY,  name TEXT NOT NULL UNIQUE,"
    "  role TEXT NOT NULL CHECK (role IN ('technician', 'instructor', 'trainee')),"
    "  password TEXT CHECK (password LIKE '$argon2%'),  trainee_id INTEGER REFERENCES trainee,"
    "  created_utc_ns INTEGER NOT NULL) STRICT;"
    "CREATE INDEX account_trainee ON account (trainee_id);"
    "CREATE TABLE audit (  id INTEGER PRIMARY KEY AUTOINCREMENT,  utc_ns INTEGER NOT NULL,"
    "  actor TEXT NOT NULL,  action TEXT NOT NULL,  subject TEXT NOT NULL) STRICT;"
    "CREATE TRIGGER audit_is_not_changed BEFORE UPDATE ON audit"
    "  BEGIN SELECT RAISE(ABORT, 'the audit log only grows'); END;"
    "CREATE TRIGGER audit_is_not_cut BEFORE DELETE ON audit"
    "  BEGIN SELECT RAISE(ABORT, 'the audit log only grows'); END;"
    "INSERT INTO account VALUES (5, 'ada', 'trainee', '$argon2id$x', 7, 12);";

// Version 3: a column more.
static const char version_3[] =
    "PRAGMA user_version = 3; ALTER TABLE session ADD COLUMN trace_hash TEXT;";

// Version 4: another table.
static const char version_4[] =
    "PRAGMA user_version = 4;"
    "CREATE TABLE token (  id INTEGER PRIMARY KEY AUTOINCREMENT,"
    "  kind TEXT NOT NULL CHECK (kind IN ('cookie', 'token', 'code')),"
    "  hash TEXT NOT NULL UNIQUE CHECK (length(hash) = 64),  account_id INTEGER REFERENCES account,"
    "  trainee_id INTEGER REFERENCES trainee,  name TEXT,  created_utc_ns INTEGER NOT NULL,"
    "  until_utc_ns INTEGER NOT NULL,  used_utc_ns INTEGER,"
    "  CHECK ((account_id IS NULL) <> (trainee_id IS NULL))) STRICT;"
    "CREATE INDEX token_account ON token (account_id);"
    "CREATE INDEX token_trainee ON token (trainee_id);"
    "INSERT INTO token VALUES (1, 'token', printf('%064d', 1), 5, NULL, 'night', 1, 2, 3),"
    "(2, 'code', printf('%064d', 2), NULL, 7, NULL, 1, 2, NULL),"
    "(3, 'cookie', printf('%064d', 3), NULL, 7, NULL, 1, 2, NULL);"
    "INSERT INTO audit VALUES (1, 11, 'grace', 'add', 'trainee 7'), "
    "(2, 12, 'server', 'open', 'station room-1'), (3, 13, 'grace', 'erase', 'trainee 9');";

// Version 5: the audit log chained, and its signature.
static const char version_5[] =
    "PRAGMA user_version = 5;"
    "DROP TRIGGER audit_is_not_changed; ALTER TABLE audit ADD COLUMN hash TEXT;"
    "UPDATE audit SET hash = CASE id "
    "WHEN 1 THEN '925c49246aa0579ac6edc78fda53f8e1fcf18e56b3f281e64904a415ea56c053' WHEN 2 THEN "
    "'1e75d78e6a75013f69e0d211b556ca1bb10bd1354e6d85a8f608feae3f977800' ELSE "
    "'6d61ee01dd289c3d4256e9457e10594bd987da0daa3fcd8532be2ce81a50478a' END;"
    "CREATE TRIGGER audit_is_not_changed BEFORE UPDATE ON audit"
    "  BEGIN SELECT RAISE(ABORT, 'the audit log only grows'); END;"
    "CREATE TABLE audit_seal (  id INTEGER PRIMARY KEY CHECK (id = 1),"
    "  entry INTEGER NOT NULL,  hash TEXT NOT NULL,  utc_ns INTEGER NOT NULL,"
    "  certificate TEXT NOT NULL,  signature TEXT NOT NULL) STRICT;"
    "DELETE FROM token WHERE trainee_id IS NOT NULL;";

static const char version_6[] =
    "CREATE TABLE attempt ("
    "  id INTEGER PRIMARY KEY,"
    "  session_id INTEGER NOT NULL REFERENCES session,"
    "  number INTEGER NOT NULL CHECK (number > 0),"
    "  task TEXT NOT NULL,"
    "  task_version INTEGER NOT NULL,"
    "  title TEXT NOT NULL,"
    "  file_hash TEXT NOT NULL CHECK (length(file_hash) = 64),"
    "  purpose TEXT NOT NULL CHECK (purpose IN ('practice', 'exam')),"
    "  hand TEXT NOT NULL CHECK (hand IN ('right', 'left')),"
    "  first_step INTEGER NOT NULL,"
    "  last_step INTEGER NOT NULL,"
    "  begun_utc_ns INTEGER NOT NULL,"
    "  time_s REAL NOT NULL,"
    "  goals INTEGER NOT NULL,"
    "  goals_met INTEGER NOT NULL,"
    "  errors INTEGER NOT NULL,"
    "  sentinel INTEGER NOT NULL CHECK (sentinel IN (0, 1)),"
    "  verdict TEXT NOT NULL CHECK (verdict IN ('passed', 'not yet')),"
    "  end TEXT NOT NULL CHECK (end IN ('done', 'time out', 'sentinel error', 'left', 'stopped')),"
    "  pass_time_s REAL NOT NULL,"
    "  pass_errors INTEGER NOT NULL,"
    "  mark_version INTEGER NOT NULL,"
    "  figures TEXT NOT NULL,"
    "  occurrences TEXT NOT NULL,"
    "  UNIQUE (session_id, number)"
    ") STRICT;"
    "CREATE INDEX attempt_task ON attempt (task, begun_utc_ns);"
    "CREATE TABLE curriculum ("
    "  id INTEGER PRIMARY KEY,"
    "  course_id INTEGER NOT NULL REFERENCES course ON DELETE CASCADE,"
    "  version INTEGER NOT NULL,"
    "  state TEXT NOT NULL CHECK (state IN ('draft', 'published', 'frozen')),"
    "  changed_utc_ns INTEGER NOT NULL,"
    "  UNIQUE (course_id, version)"
    ") STRICT;"
    "CREATE TABLE curriculum_task ("
    "  curriculum_id INTEGER NOT NULL REFERENCES curriculum ON DELETE CASCADE,"
    "  position INTEGER NOT NULL,"
    "  task TEXT NOT NULL,"
    "  week INTEGER NOT NULL,"
    "  passes INTEGER NOT NULL CHECK (passes > 0),"
    "  hands TEXT NOT NULL CHECK (hands IN ('each', 'one')),"
    "  due_utc_ns INTEGER,"
    "  cases TEXT NOT NULL,"
    "  after TEXT NOT NULL,"
    "  PRIMARY KEY (curriculum_id, position),"
    "  UNIQUE (curriculum_id, task)"
    ") STRICT;"
    "CREATE TABLE pass_mark ("
    "  task TEXT NOT NULL,"
    "  version INTEGER NOT NULL CHECK (version > 0),"
    "  task_version INTEGER NOT NULL,"
    "  kind TEXT NOT NULL CHECK (kind IN ('by hand', 'contrasting groups', 'published')),"
    "  source TEXT NOT NULL CHECK (source <> ''),"
    "  time_s REAL NOT NULL,"
    "  errors INTEGER NOT NULL,"
    "  created_utc_ns INTEGER NOT NULL,"
    "  PRIMARY KEY (task, version)"
    ") STRICT;"
    "CREATE TABLE exam ("
    "  id INTEGER PRIMARY KEY AUTOINCREMENT,"
    "  course_id INTEGER REFERENCES course ON DELETE SET NULL,"
    "  trainee_id INTEGER NOT NULL REFERENCES trainee,"
    "  title TEXT NOT NULL,"
    "  state TEXT NOT NULL CHECK (state IN ('planned', 'begun', 'done', 'released')),"
    "  seed INTEGER NOT NULL,"
    "  created_utc_ns INTEGER NOT NULL,"
    "  begun_utc_ns INTEGER,"
    "  released_utc_ns INTEGER,"
    "  who INTEGER NOT NULL DEFAULT 0,"
    "  station_check INTEGER NOT NULL DEFAULT 0,"
    "  case_hash INTEGER NOT NULL DEFAULT 0,"
    "  drift_mm REAL,"
    "  verdict TEXT CHECK (verdict IN ('passed', 'not yet')),"
    "  result TEXT,"
    "  result_hash TEXT,"
    "  certificate TEXT,"
    "  signature TEXT"
    ") STRICT;"
    "CREATE INDEX exam_trainee ON exam (trainee_id);"
    "CREATE TABLE exam_task ("
    "  exam_id INTEGER NOT NULL REFERENCES exam ON DELETE CASCADE,"
    "  position INTEGER NOT NULL,"
    "  task TEXT NOT NULL,"
    "  knee_case TEXT NOT NULL,"
    "  case_hash TEXT,"
    "  hand TEXT CHECK (hand IN ('right', 'left')),"
    "  attempt_id INTEGER REFERENCES attempt ON DELETE SET NULL,"
    "  PRIMARY KEY (exam_id, position)"
    ") STRICT;"
    "CREATE INDEX exam_task_attempt ON exam_task (attempt_id);"
    "CREATE TABLE exam_rater ("
    "  exam_id INTEGER NOT NULL REFERENCES exam ON DELETE CASCADE,"
    "  account_id INTEGER NOT NULL REFERENCES account ON DELETE CASCADE,"
    "  PRIMARY KEY (exam_id, account_id)"
    ") STRICT;"
    "CREATE INDEX exam_rater_account ON exam_rater (account_id);"
    "CREATE TABLE intervention ("
    "  id INTEGER PRIMARY KEY,"
    "  exam_id INTEGER NOT NULL REFERENCES exam ON DELETE CASCADE,"
    "  utc_ns INTEGER NOT NULL,"
    "  reason TEXT NOT NULL"
    ") STRICT;"
    "CREATE INDEX intervention_exam ON intervention (exam_id);"
    "CREATE TABLE rating ("
    "  id INTEGER PRIMARY KEY,"
    "  attempt_id INTEGER NOT NULL REFERENCES attempt ON DELETE CASCADE,"
    "  account_id INTEGER REFERENCES account ON DELETE SET NULL,"
    "  utc_ns INTEGER NOT NULL,"
    "  safety INTEGER NOT NULL CHECK (safety BETWEEN 1 AND 5),"
    "  field_of_view INTEGER NOT NULL CHECK (field_of_view BETWEEN 1 AND 5),"
    "  camera_dexterity INTEGER NOT NULL CHECK (camera_dexterity BETWEEN 1 AND 5),"
    "  instrument_dexterity INTEGER NOT NULL CHECK (instrument_dexterity BETWEEN 1 AND 5),"
    "  bimanual_dexterity INTEGER NOT NULL CHECK (bimanual_dexterity BETWEEN 1 AND 5),"
    "  flow INTEGER NOT NULL CHECK (flow BETWEEN 1 AND 5),"
    "  quality INTEGER NOT NULL CHECK (quality BETWEEN 1 AND 5),"
    "  autonomy INTEGER NOT NULL CHECK (autonomy BETWEEN 1 AND 3),"
    "  remark TEXT,"
    "  UNIQUE (attempt_id, account_id)"
    ") STRICT;"
    "CREATE INDEX rating_account ON rating (account_id);"
    "INSERT INTO attempt VALUES (1, 1, 1, 'centring', 1, 'Centring', "
    "'00000000000000000000000000000000000000000000000000000000000000ff', 'practice', 'right', 0, "
    "10, 1500, 40, 2, 2, 0, 0, 'passed', 'done', 120, 2, 0, '{}', '[]');"
    "INSERT INTO audit_seal VALUES (1, 1, 'aa', 5, 'bb', 'cc');"
    "PRAGMA user_version = 6;";

// Each older version, and what is only in those from it on.
#define PARTS 6
static const char *const versions[][PARTS] = {
    {version_1, "", "", "", "", ""},
    {version_1, version_2, "", "", "", ""},
    {version_1, version_2, version_3, "", "", ""},
    {version_1, version_2, version_3, version_4, "", ""},
    {version_1, version_2, version_3, version_4, version_5, ""},
    {version_1, version_2, version_3, version_4, version_5, version_6}};
#define OLDER (sizeof versions / sizeof *versions)

static void make_version(const char *name, size_t older) {
    for (int i = 0; i < PARTS; i++)
        assert_true(sql_passes(name, versions[older][i]));
}

static void rows_of_every_version_are_as_they_were(void **state) {
    (void)state;
    for (size_t i = 0; i < OLDER; i++) {
        char name[32];
        struct store *store;
        struct error err = {""};
        snprintf(name, sizeof name, "version-%zu.db", i + 1);
        make_version(name, i);
        assert_int_equal(store_open(in_folder(name), STORE_THERE, "tester", &store, &err),
                         RESULT_OK);
        assert_string_equal(
            rows_of(store, LIST_TRAINEES, NULL),
            "name=ada|full_name=Ada Lovelace|created_utc_ns=111|erased_utc_ns=|sessions=1\n"
            "name=erased-1|full_name=|created_utc_ns=5|erased_utc_ns=6|sessions=0\n");
        assert_string_equal(rows_of(store, LIST_ENROLMENTS, NULL), "course=autumn|trainee=ada\n");
        assert_string_equal(
            rows_of(store, LIST_SESSIONS, NULL),
            "id=0123456789abcdef0123456789abcdef|station=room-1|trainee=ada|case=tear-radial|"
            "case_hash=00000000000000ff|start_utc_ns=1000|end_utc_ns=2000|state=closed|steps=12|"
            "missing=1|trace=/t/1.trace|trace_xxh3=1111111111111111|trace_hash=|part=1|server=\n"
            "id=1123456789abcdef0123456789abcdef|station=room-1|trainee=|case=tear-radial|"
            "case_hash=00000000000000ff|start_utc_ns=3000|end_utc_ns=|state=open|steps=0|missing=0|"
            "trace=/t/2.trace|trace_xxh3=|trace_hash=|part=1|server=\n");
        assert_string_equal(rows_of(store, LIST_RESULTS, NULL),
                            "session=0123456789abcdef0123456789abcdef|metric=over|"
                            "subject=meniscus_medial|version=1|unit=mm3|value=4.5|details=\n"
                            "session=0123456789abcdef0123456789abcdef|metric=rim|"
                            "subject=meniscus_medial|version=1|unit=mm|value=|details={}\n");
        assert_int_equal(store_add_account(store, "eve", ROLE_INSTRUCTOR, NULL, NULL, &err),
                         RESULT_OK);
        assert_int_equal(row_count(store, LIST_AUDIT), i < 3 ? 1 : 4);
        assert_int_equal(row_count(store, LIST_ACCOUNTS), i ? 2 : 1);
        store_close(&store);
    }
}

// The tables as SQLite has them, without blanks.
static void schema_of(const char *name, char *out, size_t size) {
    sqlite3 *db;
    sqlite3_stmt *statement;
    size_t used = 0;
    assert_int_equal(sqlite3_open(in_folder(name), &db), SQLITE_OK);
    sqlite3_prepare_v2(db, "SELECT sql FROM sqlite_schema WHERE sql NOT NULL ORDER BY name", -1,
                       &statement, NULL);
    while (sqlite3_step(statement) == SQLITE_ROW)
        for (const char *c = (const char *)sqlite3_column_text(statement, 0); *c; c++)
            if (*c != ' ' && used + 1 < size)
                out[used++] = *c;
    out[used] = '\0';
    sqlite3_finalize(statement);
    sqlite3_close(db);
}

static void every_version_lands_at_the_tables_of_a_new_file(void **state) {
    (void)state;
    static char fresh[1 << 15], climbed[1 << 15];
    struct store *store = open_records();
    store_close(&store);
    schema_of("records.db", fresh, sizeof fresh);
    assert_non_null(strstr(fresh, "CREATETABLEsession"));
    for (size_t i = 0; i < OLDER; i++) {
        unlink(in_folder("old.db"));
        make_version("old.db", i);
        assert_int_equal(store_open(in_folder("old.db"), STORE_THERE, "tester", &store, NULL),
                         RESULT_OK);
        store_close(&store);
        schema_of("old.db", climbed, sizeof climbed);
        assert_string_equal(climbed, fresh);
    }
}

// Entries of an older program are chained as they are; codes whose hashes had no key end.
static void the_audit_log_of_an_older_file_is_chained(void **state) {
    (void)state;
    struct store *store;
    struct store_audit_head head;
    struct error err = {""};
    make_version("old.db", 3);
    assert_int_equal(store_open(in_folder("old.db"), STORE_THERE, "tester", &store, &err),
                     RESULT_OK);
    assert_int_equal(store_verify_audit(store, &head, &err), RESULT_OK);
    assert_int_equal(head.entry, 3);
    assert_string_equal(rows_of(store, LIST_AUDIT, NULL),
                        "utc_ns=11|actor=grace|action=add|subject=trainee 7\n"
                        "utc_ns=12|actor=server|action=open|subject=station room-1\n"
                        "utc_ns=13|actor=grace|action=erase|subject=trainee 9\n");
    assert_int_equal(row_count(store, LIST_TOKENS), 1);
    assert_int_equal(store_add_course(store, "winter", &err), RESULT_OK);
    assert_int_equal(store_verify_audit(store, &head, &err), RESULT_OK);
    assert_int_equal(head.entry, 4);
    store_close(&store);
    assert_false(sql_passes("old.db", "UPDATE audit SET actor = 'eve'"));
    assert_false(sql_passes("old.db", "DELETE FROM audit"));
}

static void a_step_that_fails_leaves_the_older_version_as_it_was(void **state) {
    (void)state;
    struct store *store;
    struct error err = {""};
    static char before[1 << 14], after[1 << 14];
    assert_true(sql_passes("old.db", version_1));
    assert_true(sql_passes("old.db", "CREATE TABLE audit (in_the_way INTEGER)"));
    schema_of("old.db", before, sizeof before);
    assert_int_equal(store_open(in_folder("old.db"), STORE_THERE, "tester", &store, &err),
                     RESULT_FORMAT);
    assert_null(store);
    assert_non_null(strstr(err.text, "old.db"));
    schema_of("old.db", after, sizeof after);
    assert_string_equal(after, before);
    assert_true(sql_passes("old.db", "DROP TABLE audit"));
    assert_int_equal(store_open(in_folder("old.db"), STORE_THERE, "tester", &store, &err),
                     RESULT_OK);
    store_close(&store);
}

static void *open_made(void *path) {
    struct store *store;
    struct error err = {""};
    if (store_open(path, STORE_MAKE, "tester", &store, &err) != RESULT_OK)
        return alloc_text(err.text);
    store_close(&store);
    return NULL;
}

static void open_four_times_at_once(const char *path) {
    pthread_t threads[4];
    for (int i = 0; i < 4; i++)
        assert_int_equal(pthread_create(&threads[i], NULL, open_made, (void *)path), 0);
    for (int i = 0; i < 4; i++) {
        void *failed;
        pthread_join(threads[i], &failed);
        if (failed)
            fail_msg("%s", (char *)failed);
    }
}

static void several_programs_may_meet_an_older_file_at_once(void **state) {
    (void)state;
    assert_true(sql_passes("old.db", version_1));
    open_four_times_at_once(in_folder("old.db"));
}

static void several_programs_may_make_the_same_file_at_once(void **state) {
    (void)state;
    for (int round = 0; round < 25; round++) {
        open_four_times_at_once(store_path);
        assert_int_equal(unlink(store_path), 0);
    }
}

static void a_newer_file_is_refused_and_left_alone(void **state) {
    (void)state;
    struct error err = {""};
    char aside[STORE_TEXT_MAX];
    struct store *store = open_records();
    store_close(&store);
    assert_true(sql_passes("records.db", "PRAGMA user_version = 8"));
    assert_int_equal(store_open(store_path, STORE_MAKE, "tester", &store, &err), RESULT_VERSION);
    assert_non_null(strstr(err.text, "version 8; this one reads up to 7"));
    assert_int_equal(store_restore(store_path, in_folder("other.db"), "tester", aside, &err),
                     RESULT_VERSION);
    assert_true(sql_passes("records.db", "PRAGMA user_version = 7"));
    store = open_records();
    store_close(&store);
}

int main(void) {
    const struct CMUnitTest tests[] = {
#define TEST(f) cmocka_unit_test_setup_teardown(f, store_folder_begin, store_folder_end)
        TEST(rows_of_every_version_are_as_they_were),
        TEST(every_version_lands_at_the_tables_of_a_new_file),
        TEST(the_audit_log_of_an_older_file_is_chained),
        TEST(a_step_that_fails_leaves_the_older_version_as_it_was),
        TEST(several_programs_may_meet_an_older_file_at_once),
        TEST(several_programs_may_make_the_same_file_at_once),
        TEST(a_newer_file_is_refused_and_left_alone),
    };
    return cmocka_run_group_tests_name("store_versions", tests, NULL, NULL);
}
