// Records that servers share: whatever each of them writes, and however late it learns what the
// others wrote, in the end all have the same rows, whole chains of the audit log, and whole tables.
#include "random.h"
#include "store/exams.h"
#include "store/share.h"
#include "test.h"
#include "unit/store_files.h"

#include <sqlite3.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define SERVERS 3
#define STEPS 160
#define HISTORIES 8
#define NAMES 5

static struct error err;
static struct random chance;

static unsigned any(unsigned below) {
    return (unsigned)(random_bits(&chance) % below);
}

// ---- the order, which a stream keeps in earnest -------------------------------------------------

static struct sent {
    struct store_change change;
    uint8_t *bytes;
} order[SERVERS * STEPS * 8];
static int order_count, slot_count;

static struct server {
    char path[FOLDER_MAX + 32];
    int slot; // one that joins anew gets another one
    int64_t published;
    int dropped;
} servers[SERVERS];

static struct store *open_of(int i) {
    struct store *store;
    assert_ok(store_open(servers[i].path, STORE_MAKE, "tester", &store, &err));
    return store;
}

static void put_in_order(int slot, int64_t number, int piece, bool goes_on, const uint8_t *bytes,
                         size_t size) {
    struct sent *sent = &order[order_count++];
    assert_true(order_count <= (int)(sizeof order / sizeof *order));
    sent->bytes = malloc(size + 1);
    memcpy(sent->bytes, bytes, size);
    sent->change = (struct store_change){slot, number, piece, goes_on, sent->bytes, size};
}

// In one piece or two. A server that was interrupted begins again, and so does one that got no
// answer.
static void put_change(int slot, int64_t number, const uint8_t *bytes, size_t size) {
    size_t first = any(3) ? 0 : any((unsigned)size);
    for (unsigned again = 0; first && again <= any(3) / 2; again++)
        put_in_order(slot, number, 0, true, bytes, first);
    put_in_order(slot, number, first > 0, false, bytes + first, size - first);
    if (any(4) == 0)
        put_in_order(slot, number, 0, false, bytes, size);
}

static bool publish(int i) {
    struct store *store = open_of(i);
    uint8_t *bytes;
    size_t size;
    int64_t number;
    bool some =
        store_own_change(store, servers[i].published, &number, &bytes, &size, &err) == RESULT_OK;
    if (some) {
        put_change(servers[i].slot, number, bytes, size);
        servers[i].published = number;
    }
    free(bytes);
    store_close(&store);
    return some;
}

static bool take_next(int i) {
    struct store *store = open_of(i);
    struct store_share share;
    bool dropped;
    assert_ok(store_share(store, &share, &err));
    bool some = share.applied < order_count;
    if (some) {
        assert_ok(
            store_apply(store, &order[share.applied].change, share.applied + 1, &dropped, &err));
        servers[i].dropped += dropped;
    }
    store_close(&store);
    return some;
}

static void take_all(void) {
    for (int i = 0; i < SERVERS; i++)
        while (publish(i))
            ;
    for (int i = 0; i < SERVERS; i++)
        while (take_next(i))
            ;
}

// ---- what servers write -------------------------------------------------------------------------

static const char *name(void) {
    static const char *const names[NAMES] = {"ada", "eve", "fay", "gus", "ian"};
    return names[any(NAMES)];
}

static const char *course(void) {
    return any(2) ? "autumn" : "spring";
}

static struct store_session some_session(void) {
    struct store_session session = a_session(any(9));
    snprintf(session.trainee, sizeof session.trainee, "%s", name());
    snprintf(session.station, sizeof session.station, "room-%u", any(3));
    session.part = 1 + (int)any(2);
    snprintf(session.trace, sizeof session.trace, "%.64s/%.8s-%d.trace", store_dir, session.id + 24,
             session.part);
    session.state = any(2) ? STATE_OPEN : STATE_CLOSED;
    session.steps = any(1000);
    return session;
}

// What contradicts the records is refused here, as at any server.
static void write_some(struct store *store) {
    const struct store_result result = {"time", "", 1, "s", any(100), ""};
    struct store_session session = some_session();
    struct attempt_row attempt = an_attempt(session.id, 1 + (int)any(3));
    struct store_principal ian;
    char text[STORE_NAME_MAX], hash[65];
    int64_t id, until;
    bool is_new;
    snprintf(hash, sizeof hash, "%032llx%032llx", (unsigned long long)random_bits(&chance), 0ull);
    switch (any(15)) {
    case 0:
        store_add_trainee(store, name(), "Full Name", NULL);
        break;
    case 1:
        store_add_course(store, course(), NULL);
        break;
    case 2:
        store_enrol(store, name(), course(), NULL);
        break;
    case 3:
        store_unenrol(store, name(), course(), NULL);
        break;
    case 4:
        store_change_trainee(store, name(), any(2) ? name() : NULL, "Another Name", NULL);
        break;
    case 5:
        store_remove_trainee(store, name(), NULL);
        break;
    case 6:
        store_erase_trainee(store, name(), text, NULL);
        break;
    case 7:
        store_remove_course(store, course(), NULL);
        break;
    case 8:
        store_add_account(store, name(), ROLE_TRAINEE, NULL, name(), NULL);
        break;
    case 9:
        store_remove_account(store, name(), NULL);
        break;
    case 10:
        if (store_find_account(store, name(), &ian, NULL) == RESULT_OK)
            store_add_token(store, TOKEN_BEARER, hash, &ian, "a token", &id, &until, NULL);
        break;
    case 11:
        store_note(store, "look", "station room-1", NULL);
        break;
    case 12:
        store_attempt_add(store, &attempt, &is_new, NULL);
        break;
    case 13:
        store_remove_session(store, session.id, NULL);
        break;
    default:
        assert_ok(store_put_session(store, &session, &result, 1, &err));
    }
}

// ---- that all are the same ----------------------------------------------------------------------

static const char *const tables[] = {"trainee", "course",  "enrolment", "station",    "knee_case",
                                     "session", "part",    "result",    "account",    "audit",
                                     "token",   "attempt", "exam",      "audit_seal", "sender"};

// All rows of a table, in the order of its columns.
static char *dump(int i, const char *table) {
    sqlite3 *db;
    sqlite3_stmt *statement;
    char sql[64], *text = NULL;
    size_t size;
    FILE *file = open_memstream(&text, &size);
    assert_int_equal(sqlite3_open_v2(servers[i].path, &db, SQLITE_OPEN_READONLY, NULL), SQLITE_OK);
    snprintf(sql, sizeof sql, "SELECT * FROM %s ORDER BY 1, 2", table);
    assert_int_equal(sqlite3_prepare_v2(db, sql, -1, &statement, NULL), SQLITE_OK);
    while (sqlite3_step(statement) == SQLITE_ROW) {
        for (int c = 0; c < sqlite3_column_count(statement); c++)
            fprintf(file, "%s|", sqlite3_column_text(statement, c));
        fputc('\n', file);
    }
    sqlite3_finalize(statement);
    sqlite3_close(db);
    fclose(file);
    return text;
}

static void all_are_the_same(void) {
    for (size_t t = 0; t < sizeof tables / sizeof *tables; t++) {
        char *first = dump(0, tables[t]);
        for (int i = 1; i < SERVERS; i++) {
            char *other = dump(i, tables[t]);
            if (strcmp(first, other))
                fail_msg("%s: server 0 has\n%sand server %d\n%s", tables[t], first, i, other);
            free(other);
        }
        free(first);
    }
}

static void all_are_whole(void) {
    for (int i = 0; i < SERVERS; i++) {
        struct store_audit_head head;
        struct store *store = open_of(i);
        assert_ok(store_verify_audit(store, &head, &err));
        if (head.entry)
            assert_ok(store_audit_has(store, &head, &err));
        assert_ok(store_backup(store, in_folder("whole.db"), &err)); // which checks it
        unlink(in_folder("whole.db"));
        store_close(&store);
    }
}

// ---- histories ----------------------------------------------------------------------------------

static struct store_member member(int i) {
    struct store_member member = {.order = "0123", .slot = servers[i].slot};
    snprintf(member.server, sizeof member.server, "s%d", i);
    snprintf(member.file, sizeof member.file, "f%d", servers[i].slot);
    return member;
}

static void end(void) {
    static const char *const more[] = {"", "-wal", "-shm", "-lock"};
    for (; order_count; order_count--)
        free(order[order_count - 1].bytes);
    for (int i = 0; i < SERVERS; i++)
        for (int k = 0; k < 4; k++) {
            char path[FOLDER_MAX + 48];
            snprintf(path, sizeof path, "%.99s%s", servers[i].path, more[k]);
            unlink(path);
        }
}

static void begin(void) {
    end(); // of a test that failed
    slot_count = SERVERS;
    for (int i = 0; i < SERVERS; i++) {
        servers[i] = (struct server){.slot = i};
        char file[16];
        snprintf(file, sizeof file, "%d.db", i);
        snprintf(servers[i].path, sizeof servers[i].path, "%.99s", in_folder(file));
        struct store *store = open_of(i);
        struct store_member self = member(i);
        assert_ok(store_share_begin(store, &self, &err));
        store_close(&store);
    }
}

static void copy_of_first(char copy[FOLDER_MAX + 16]) {
    int64_t place;
    snprintf(copy, FOLDER_MAX + 16, "%.99s", in_folder("copy.db"));
    while (publish(0))
        ;
    while (take_next(0))
        ;
    struct store *store = open_of(0);
    assert_ok(store_share_copy(store, copy, &place, &err));
    store_close(&store);
    assert_int_equal(place, order_count);
}

// It takes its records from a copy of server 0, as one that came late, and goes on; or as one whose
// own were replaced, and are put aside.
static void load_copy(int i, bool anew) {
    char copy[FOLDER_MAX + 16], aside[STORE_TEXT_MAX];
    copy_of_first(copy);
    if (anew) {
        servers[i].slot = slot_count++;
        servers[i].published = 0;
    }
    struct store_member self = member(i);
    assert_ok(store_share_load(copy, servers[i].path, &self, aside, &err));
    assert_true(!aside[0] == !anew);
    if (anew)
        unlink(aside);
    unlink(copy);
}

static void run_history(uint64_t seed) {
    chance.state = seed;
    begin();
    for (int step = 0; step < STEPS; step++) {
        int i = (int)any(SERVERS);
        unsigned what = any(12);
        struct store *store = open_of(i);
        if (what < 6)
            write_some(store);
        store_close(&store);
        if (what >= 6 && what < 8)
            publish(i);
        if (what >= 8)
            take_next(i);
        if (any(40) == 0)
            load_copy(1 + (int)any(SERVERS - 1), any(3) == 0 && slot_count < STORE_SERVERS_MAX);
    }
    take_all();
    all_are_the_same();
    all_are_whole();
    end();
}

static void all_come_to_the_same(void **state) {
    (void)state;
    for (uint64_t seed = 1; seed <= HISTORIES; seed++)
        run_history(seed);
}

// ---- what counts where two contradict each other ------------------------------------------------

static void the_first_of_two_with_one_name_counts(void **state) {
    (void)state;
    begin();
    for (int i = 0; i < 2; i++) {
        struct store *store = open_of(i);
        assert_ok(store_add_trainee(store, "ada", i ? "The later one" : "The first", &err));
        store_close(&store);
    }
    take_all();
    all_are_the_same();
    struct store *store = open_of(1);
    assert_non_null(strstr(rows_of(store, LIST_TRAINEES, NULL), "full_name=The first"));
    assert_int_equal(row_count(store, LIST_TRAINEES), 1);
    assert_int_equal(row_count(store, LIST_AUDIT), 2); // what was tried is not forgotten
    store_close(&store);
    for (int i = 0; i < SERVERS; i++)
        assert_int_equal(servers[i].dropped, 1);
    end();
}

static void a_field_that_two_change_has_the_later_value(void **state) {
    (void)state;
    begin();
    struct store *store = open_of(0);
    assert_ok(store_add_trainee(store, "ada", "Ada", &err));
    store_close(&store);
    take_all();
    for (int i = 0; i < 2; i++) {
        store = open_of(i);
        assert_ok(store_change_trainee(store, "ada", NULL, i ? "The later" : "The first", &err));
        store_close(&store);
    }
    take_all();
    all_are_the_same();
    store = open_of(2);
    assert_non_null(strstr(rows_of(store, LIST_TRAINEES, NULL), "full_name=The later"));
    store_close(&store);
    end();
}

static void first_sessions_of_two_servers_at_one_station_both_stay(void **state) {
    (void)state;
    begin();
    for (int i = 0; i < 2; i++) {
        struct store *store = open_of(i);
        struct store_session session = a_session((unsigned)i);
        session.trainee[0] = '\0';
        assert_ok(store_put_session(store, &session, NULL, 0, &err));
        store_close(&store);
    }
    take_all();
    all_are_the_same();
    struct store *store = open_of(2);
    assert_int_equal(row_count(store, LIST_SESSIONS), 2);
    assert_int_equal(row_count(store, LIST_STATIONS), 1);
    store_close(&store);
    end();
}

static void a_session_has_a_part_at_each_server(void **state) {
    (void)state;
    struct store_session session = a_session(1);
    begin();
    for (int i = 0; i < 2; i++) {
        struct store *store = open_of(i);
        session.part = i + 1;
        assert_ok(store_put_session(store, &session, NULL, 0, &err));
        store_close(&store);
        take_all();
    }
    struct store *store = open_of(0); // has learnt its end
    session.part = 1;
    session.state = STATE_INTERRUPTED;
    snprintf(session.trace_hash, sizeof session.trace_hash, "ab");
    assert_ok(store_put_session(store, &session, NULL, 0, &err));
    store_close(&store);
    take_all();
    all_are_the_same();
    store = open_of(2);
    assert_non_null(strstr(rows_of(store, LIST_SESSIONS, NULL), "state=open"));
    assert_non_null(strstr(rows_of(store, LIST_SESSIONS, NULL), "part=2|server=s1"));
    assert_non_null(strstr(rows_of(store, LIST_PARTS, session.id),
                           "number=1|server=s0|end_utc_ns=|state=interrupted|steps=0|missing=0|"
                           "trace=/traces/1.trace|trace_xxh3=|trace_hash=ab"));
    store_close(&store);
    end();
}

static void an_earlier_part_does_not_end_its_session(void **state) {
    (void)state;
    struct store_session session = a_session(1);
    begin();
    struct store *store = open_of(0);
    assert_ok(store_put_session(store, &session, NULL, 0, &err));
    store_close(&store);
    take_all();
    store = open_of(1);
    session.part = 2;
    session.steps = 70;
    assert_ok(store_put_session(store, &session, NULL, 0, &err));
    store_close(&store);
    store = open_of(0); // it started again, and knows of no other part
    session.part = 1;
    session.steps = 30;
    session.state = STATE_INTERRUPTED;
    assert_ok(store_put_session(store, &session, NULL, 0, &err));
    store_close(&store);
    publish(1);
    take_all();
    all_are_the_same();
    store = open_of(0);
    assert_non_null(strstr(rows_of(store, LIST_SESSIONS, NULL), "state=open|steps=70"));
    assert_non_null(strstr(rows_of(store, LIST_SESSIONS, NULL), "part=2|server=s1"));
    store_close(&store);
    end();
}

static void the_trace_of_a_session_that_is_dropped_stays(void **state) {
    (void)state;
    begin();
    put_file("kept.trace", "x", 1);
    for (int i = 0; i < 2; i++) { // both add the trainee
        struct store *store = open_of(i);
        struct store_session session = a_session((unsigned)i);
        snprintf(session.trace, sizeof session.trace, "%s", in_folder("kept.trace"));
        assert_ok(store_put_session(store, &session, NULL, 0, &err));
        store_close(&store);
    }
    take_all();
    all_are_the_same();
    assert_int_equal(servers[1].dropped, 1);
    assert_int_equal(access(in_folder("kept.trace"), F_OK), 0);
    end();
}

static void sign_in(struct store *store, const char *account, char fill) {
    struct store_principal who;
    int64_t id, until;
    char hash[65];
    memset(hash, fill, 64);
    hash[64] = '\0';
    assert_ok(store_find_account(store, account, &who, &err));
    assert_ok(store_add_token(store, TOKEN_COOKIE, hash, &who, NULL, &id, &until, &err));
}

static void who_is_removed_or_erased_stays_so(void **state) {
    (void)state;
    char pseudonym[STORE_NAME_MAX];
    begin();
    struct store *store = open_of(0);
    assert_ok(store_add_trainee(store, "ada", NULL, &err));
    assert_ok(store_add_account(store, "ada", ROLE_TRAINEE, NULL, "ada", &err));
    assert_ok(store_add_account(store, "tom", ROLE_TECHNICIAN, NULL, NULL, &err));
    store_close(&store);
    take_all();
    store = open_of(1); // comes first in the order
    sign_in(store, "ada", 'a');
    sign_in(store, "tom", 'b');
    assert_ok(store_change_trainee(store, "ada", NULL, "Ada Lovelace", &err));
    store_close(&store);
    while (publish(1))
        ;
    store = open_of(0);
    assert_ok(store_remove_account(store, "tom", &err));
    assert_ok(store_erase_trainee(store, "ada", pseudonym, &err));
    store_close(&store);
    while (publish(0))
        ;
    store = open_of(2); // comes last
    assert_ok(store_change_trainee(store, "ada", "ada lovelace", "Ada Lovelace", &err));
    store_close(&store);
    take_all();
    all_are_the_same();
    for (int i = 0; i < SERVERS; i++) {
        store = open_of(i);
        assert_int_equal(row_count(store, LIST_ACCOUNTS), 0);
        assert_int_equal(row_count(store, LIST_TOKENS), 0);
        assert_non_null(strstr(rows_of(store, LIST_TRAINEES, NULL), pseudonym));
        assert_null(strstr(rows_of(store, LIST_TRAINEES, NULL), "ovelace"));
        store_close(&store);
    }
    end();
}

static void no_number_is_given_twice(void **state) {
    (void)state;
    begin();
    struct store *store = open_of(0);
    assert_ok(store_add_account(store, "tom", ROLE_TECHNICIAN, NULL, NULL, &err));
    store_close(&store);
    take_all();
    store = open_of(1);
    sign_in(store, "tom", 'b');
    store_close(&store);
    store = open_of(0);
    assert_ok(store_remove_account(store, "tom", &err));
    assert_ok(store_add_account(store, "eve", ROLE_TECHNICIAN, NULL, NULL, &err));
    store_close(&store);
    take_all();
    all_are_the_same();
    store = open_of(2);
    assert_int_equal(row_count(store, LIST_TOKENS), 0);
    store_close(&store);
    end();
}

static void an_older_copy_of_a_file_joins_anew(void **state) {
    (void)state;
    size_t size;
    begin();
    void *old = get_file("1.db", &size);
    struct store *store = open_of(1);
    assert_ok(store_add_trainee(store, "ada", NULL, &err));
    store_close(&store);
    publish(1);
    unlink(servers[1].path);
    put_file("1.db", old, size);
    free(old);
    bool dropped;
    store = open_of(1);
    assert_int_equal(store_apply(store, &order[0].change, 1, &dropped, &err), RESULT_REFUSED);
    assert_non_null(strstr(err.text, "older copy"));
    store_close(&store);
    load_copy(1, true);
    take_all();
    all_are_the_same();
    end();
}

static void a_trace_goes_with_its_session(void **state) {
    (void)state;
    struct store_session session = a_session(1);
    begin();
    put_file("1.trace", "x", 1);
    snprintf(session.trace, sizeof session.trace, "%s", in_folder("1.trace"));
    session.state = STATE_CLOSED;
    struct store *store = open_of(0);
    assert_ok(store_put_session(store, &session, NULL, 0, &err));
    store_close(&store);
    take_all();
    store = open_of(1);
    snprintf(session.trace, sizeof session.trace, "/nowhere");
    session.part = 2; // at server 1 by now
    assert_ok(store_put_session(store, &session, NULL, 0, &err));
    assert_ok(store_remove_session(store, session.id, &err));
    store_close(&store);
    assert_int_equal(access(in_folder("1.trace"), F_OK), 0);
    take_all();
    assert_int_equal(access(in_folder("1.trace"), F_OK), -1);
    all_are_the_same();
    end();
}

static void records_of_before_are_kept_beside(void **state) {
    (void)state;
    char aside[STORE_TEXT_MAX];
    int64_t place;
    begin();
    struct store *store = open_of(0);
    assert_ok(store_add_trainee(store, "ada", NULL, &err));
    store_close(&store);
    take_all();
    store = open_of(0);
    assert_ok(store_share_copy(store, in_folder("copy.db"), &place, &err));
    store_close(&store);
    snprintf(servers[1].path, sizeof servers[1].path, "%s", in_folder("alone.db"));
    store = open_of(1);
    assert_ok(store_add_trainee(store, "eve", NULL, &err));
    store_close(&store);
    struct store_member self = member(1);
    assert_ok(store_share_load(in_folder("copy.db"), servers[1].path, &self, aside, &err));
    assert_int_equal(access(aside, F_OK), 0);
    store = open_of(1);
    assert_non_null(strstr(rows_of(store, LIST_TRAINEES, NULL), "name=ada"));
    assert_int_equal(row_count(store, LIST_TRAINEES), 1);
    store_close(&store);
    end();
}

static void a_change_that_never_came_is_told(void **state) {
    (void)state;
    bool dropped;
    const struct store_change change = {.slot = 1, .number = 2, .bytes = (const uint8_t *)""};
    begin();
    struct store *store = open_of(0);
    assert_int_equal(store_apply(store, &change, 1, &dropped, &err), RESULT_MISSING);
    assert_non_null(strstr(err.text, "change 1 of server 1 never came"));
    store_close(&store);
    end();
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(all_come_to_the_same),
        cmocka_unit_test(the_first_of_two_with_one_name_counts),
        cmocka_unit_test(a_field_that_two_change_has_the_later_value),
        cmocka_unit_test(first_sessions_of_two_servers_at_one_station_both_stay),
        cmocka_unit_test(a_session_has_a_part_at_each_server),
        cmocka_unit_test(an_earlier_part_does_not_end_its_session),
        cmocka_unit_test(the_trace_of_a_session_that_is_dropped_stays),
        cmocka_unit_test(who_is_removed_or_erased_stays_so),
        cmocka_unit_test(no_number_is_given_twice),
        cmocka_unit_test(an_older_copy_of_a_file_joins_anew),
        cmocka_unit_test(a_trace_goes_with_its_session),
        cmocka_unit_test(records_of_before_are_kept_beside),
        cmocka_unit_test(a_change_that_never_came_is_told),
    };
    return cmocka_run_group_tests(tests, store_folder_begin, store_folder_end);
}
