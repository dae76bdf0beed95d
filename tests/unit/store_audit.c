// The chain of the audit log, the signature of its end, and what is kept of it beside the keys:
// what somebody changes in the file, without our program and without its triggers, is found.
#include "folder.h"
#include "net/authority.h"
#include "net/signer.h"
#include "records/audit_head.h"
#include "records/audit_seal.h"
#include "test.h"
#include "unit/store_files.h"

#include <sqlite3.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define ENTRIES 40

static struct error err;
static char keys[FOLDER_MAX + 16], authority[FOLDER_MAX + 48];
static struct trace_signer signer = {.sign = signer_sign};

static int begin(void **state) {
    int made = store_folder_begin(state);
    struct store *store = open_records();
    for (int i = 0; i < ENTRIES; i++) {
        struct store_audit_entry entry = {1000 + i, "server", "open", ""};
        snprintf(entry.subject, sizeof entry.subject, "station %d", i);
        assert_int_equal(store_put_audit(store, &entry, &err), RESULT_OK);
    }
    store_close(&store);
    return made;
}

static enum result verify(struct store_audit_head *out_head) {
    struct store *store = open_records();
    enum result result = store_verify_audit(store, out_head, &err);
    store_close(&store);
    return result;
}

#define NO_TRIGGERS "DROP TRIGGER audit_is_not_changed; DROP TRIGGER audit_is_not_cut;"

static void what_was_written_is_whole(void **state) {
    (void)state;
    struct store_audit_head head, last;
    struct store *store = open_records();
    assert_int_equal(verify(&head), RESULT_OK);
    assert_int_equal(head.entry, ENTRIES);
    assert_int_equal(store_audit_head(store, &last, &err), RESULT_OK);
    assert_memory_equal(&last, &head, sizeof head);
    assert_int_equal(store_audit_has(store, &head, &err), RESULT_OK);
    head.hash[0] = head.hash[0] == '0' ? '1' : '0';
    assert_int_equal(store_audit_has(store, &head, &err), RESULT_MISSING);
    store_close(&store);
}

static void others_write_while_it_is_verified(void **state) {
    (void)state;
    sqlite3 *other;
    struct store_audit_head head;
    assert_int_equal(sqlite3_open(store_path, &other), SQLITE_OK);
    assert_int_equal(sqlite3_exec(other, "BEGIN IMMEDIATE", NULL, NULL, NULL), SQLITE_OK);
    assert_int_equal(verify(&head), RESULT_OK);
    assert_int_equal(sqlite3_close(other), SQLITE_OK);
}

// By another implementation: sha256 of the fields, each with its length before it.
static void the_first_hash_is_that_of_its_fields(void **state) {
    (void)state;
    char expected[65], text[256], command[400];
    snprintf(text, sizeof text, "64:%064d1:14:10006:server4:open9:station 0", 0);
    snprintf(command, sizeof command, "printf '%%s' '%s' | sha256sum", text);
    FILE *out = popen(command, "r");
    assert_non_null(out);
    assert_int_equal(fscanf(out, "%64s", expected), 1);
    pclose(out);
    struct store *store = open_records();
    struct store_audit_head first = {.entry = 1};
    memcpy(first.hash, expected, sizeof expected);
    assert_int_equal(store_audit_has(store, &first, &err), RESULT_OK);
    store_close(&store);
}

static void every_change_is_found_and_its_entry_named(void **state) {
    (void)state;
    static const struct {
        const char *sql, *said;
    } changes[] = {
        {"UPDATE audit SET actor = 'eve' WHERE id = 7", "entry 7 "},
        {"UPDATE audit SET action = 'end' WHERE id = 1", "entry 1 "},
        {"UPDATE audit SET subject = 'station 4 ' WHERE id = 5", "entry 5 "},
        {"UPDATE audit SET utc_ns = 1 WHERE id = 40", "entry 40 "},
        {"UPDATE audit SET hash = NULL WHERE id = 9", "entry 9 "},
        {"UPDATE audit SET hash = (SELECT hash FROM audit WHERE id = 3) WHERE id = 9", "entry 9 "},
        {"DELETE FROM audit WHERE id = 12", "entry 12 "},
        {"DELETE FROM audit WHERE id = 1", "entry 1 "},
        {"DELETE FROM audit WHERE id > 30", "entry 31 "},
        {"DELETE FROM audit", "entry 1 "},
        {"INSERT INTO audit (utc_ns, actor, action, subject) VALUES (1, 'a', 'b', 'c')",
         "entry 41 "},
        {"UPDATE audit SET id = -1 WHERE id = 4; UPDATE audit SET id = 4 WHERE id = 5;"
         "UPDATE audit SET id = 5 WHERE id = -1",
         "entry 4 "},
    };
    for (size_t i = 0; i < sizeof changes / sizeof *changes; i++) {
        struct store_audit_head head;
        if (i)
            begin(state);
        assert_int_equal(verify(&head), RESULT_OK);
        if (!strncmp(changes[i].sql, "INSERT", 6))
            assert_true(sql_passes("records.db", changes[i].sql));
        else
            assert_false(sql_passes("records.db", changes[i].sql));
        assert_true(sql_passes("records.db", NO_TRIGGERS));
        if (strncmp(changes[i].sql, "INSERT", 6) != 0)
            assert_true(sql_passes("records.db", changes[i].sql));
        assert_int_equal(verify(&head), RESULT_CORRUPT);
        if (!strstr(err.text, changes[i].said))
            fail_msg("%s: %s", changes[i].sql, err.text);
        if (i + 1 < sizeof changes / sizeof *changes)
            store_folder_end(state);
    }
}

// ---- signed -------------------------------------------------------------------------------------

static void make_keys(const char *name) {
    static const char *const hosts[] = {"localhost"};
    struct signer *s;
    snprintf(keys, sizeof keys, "%s/%s", store_dir, name);
    snprintf(authority, sizeof authority, "%s/authority.pem", keys);
    assert_int_equal(authority_init(keys, hosts, 1, &err), RESULT_OK);
    assert_int_equal(signer_create(keys, &s, &err), RESULT_OK);
    signer.context = s;
}

static void drop_keys(void) {
    struct signer *s = signer.context;
    signer_destroy(&s);
}

static enum result renew(int64_t *out_entry) {
    struct store_audit_head head = {0};
    struct store *store = open_records();
    enum result result = audit_seal_renew(store, &signer, authority, &head, &err);
    *out_entry = head.entry;
    store_close(&store);
    return result;
}

static enum result check_seal(int64_t *out_entry) {
    struct store_audit_seal seal;
    char signed_by[TRACE_SIGNED_BY_MAX];
    struct store *store = open_records();
    enum result result = store_audit_seal(store, &seal, &err);
    if (result == RESULT_OK)
        result = audit_seal_check(&seal, authority, signed_by, &err);
    *out_entry = seal.head.entry;
    store_close(&store);
    return result;
}

static void the_end_is_signed_and_signed_again_when_there_is_more(void **state) {
    (void)state;
    int64_t entry;
    make_keys("keys");
    assert_int_equal(check_seal(&entry), RESULT_MISSING);
    assert_int_equal(renew(&entry), RESULT_OK);
    assert_int_equal(check_seal(&entry), RESULT_OK);
    assert_int_equal(entry, ENTRIES);
    struct store *store = open_records();
    assert_int_equal(store_note(store, "code", "station room-1", &err), RESULT_OK);
    store_close(&store);
    assert_int_equal(check_seal(&entry), RESULT_OK);
    assert_int_equal(entry, ENTRIES);
    assert_int_equal(renew(&entry), RESULT_OK);
    assert_int_equal(check_seal(&entry), RESULT_OK);
    assert_int_equal(entry, ENTRIES + 1);
    drop_keys();
}

// Somebody drops the triggers and calculates all hashes again, as whoever can write the file may.
static void write_again(const char *actor) {
    assert_true(sql_passes("records.db", NO_TRIGGERS ""
                                                     "DELETE FROM audit;"
                                                     "DELETE FROM sqlite_sequence;"));
    struct store *store = open_records();
    for (int i = 0; i < ENTRIES; i++) {
        struct store_audit_entry entry = {1000 + i, "server", "open", ""};
        snprintf(entry.actor, sizeof entry.actor, "%s", actor);
        snprintf(entry.subject, sizeof entry.subject, "station %d", i);
        assert_int_equal(store_put_audit(store, &entry, &err), RESULT_OK);
    }
    store_close(&store);
}

static void a_log_that_was_written_again_does_not_fit_its_signature(void **state) {
    (void)state;
    int64_t entry;
    struct store_audit_head head;
    make_keys("keys");
    assert_int_equal(renew(&entry), RESULT_OK);
    write_again("eve");
    assert_int_equal(verify(&head), RESULT_OK); // the hashes alone do not tell
    assert_int_equal(head.entry, ENTRIES);
    assert_int_equal(renew(&entry), RESULT_MISSING); // and a server does not sign it
    assert_non_null(strstr(err.text, "entry 40 of the audit log is missing, or was changed"));
    drop_keys();
}

static void a_signature_of_somebody_else_is_none(void **state) {
    (void)state;
    int64_t entry;
    make_keys("others");
    assert_int_equal(renew(&entry), RESULT_OK);
    drop_keys();
    make_keys("keys");
    assert_int_equal(check_seal(&entry), RESULT_REFUSED);
    assert_int_equal(renew(&entry), RESULT_REFUSED);
    assert_true(sql_passes("records.db", "UPDATE audit_seal SET signature = 'x'"));
    assert_int_equal(check_seal(&entry), RESULT_FORMAT);
    assert_int_equal(renew(&entry), RESULT_FORMAT);
    drop_keys();
}

static void what_was_signed_does_not_move_to_another_entry(void **state) {
    (void)state;
    int64_t entry;
    make_keys("keys");
    assert_int_equal(renew(&entry), RESULT_OK);
    assert_true(sql_passes("records.db", "UPDATE audit_seal SET entry = 39"));
    assert_int_equal(check_seal(&entry), RESULT_REFUSED);
    assert_true(sql_passes("records.db",
                           "UPDATE audit_seal SET hash = (SELECT hash FROM audit WHERE id = 39)"));
    assert_int_equal(check_seal(&entry), RESULT_REFUSED);
    drop_keys();
}

// ---- kept beside the keys -----------------------------------------------------------------------

static void what_is_cut_off_is_missed_with_or_without_its_signature(void **state) {
    (void)state;
    static const char cut[] =
        NO_TRIGGERS "DELETE FROM audit WHERE id > 30;"
                    "UPDATE sqlite_sequence SET seq = 30 WHERE name = 'audit'";
    char path[FOLDER_MAX + 48];
    int64_t entry;
    struct store_audit_head head, kept;
    make_keys("keys");
    assert_int_equal(audit_head_read(authority, &kept, &err), RESULT_MISSING);
    assert_int_equal(renew(&entry), RESULT_OK);
    assert_int_equal(audit_head_read(authority, &kept, &err), RESULT_OK);
    assert_int_equal(kept.entry, ENTRIES);
    assert_true(sql_passes("records.db", cut));
    assert_int_equal(verify(&head), RESULT_OK); // it looks whole
    assert_int_equal(head.entry, 30);
    assert_int_equal(renew(&entry), RESULT_MISSING);
    assert_true(sql_passes("records.db", "DELETE FROM audit_seal"));
    assert_int_equal(renew(&entry), RESULT_MISSING);
    assert_non_null(strstr(err.text, "entry 40 of the audit log"));
    assert_non_null(strstr(err.text, "keys/audit.head"));
    assert_int_equal(check_seal(&entry), RESULT_MISSING); // it was not signed again
    snprintf(path, sizeof path, "%s/audit.head", keys);
    assert_int_equal(unlink(path), 0); // somebody decides so
    assert_int_equal(renew(&entry), RESULT_OK);
    assert_int_equal(entry, 30);
    drop_keys();
}

static void put_back(const char *name) {
    char aside[STORE_TEXT_MAX];
    assert_int_equal(store_restore(in_folder(name), store_path, "eve", aside, &err), RESULT_OK);
}

static void a_backup_that_is_put_back_is_whole_and_an_older_one_is_noticed(void **state) {
    (void)state;
    int64_t entry;
    struct store_audit_head head;
    make_keys("keys");
    assert_int_equal(renew(&entry), RESULT_OK);
    struct store *store = open_records();
    assert_int_equal(store_backup(store, in_folder("backup.db"), &err), RESULT_OK);
    store_close(&store);
    for (int i = 0; i < 2; i++) { // the second time the server has signed what the backup lacks
        put_back("backup.db");
        assert_int_equal(verify(&head), RESULT_OK);
        assert_int_equal(head.entry, ENTRIES + 1); // "restore"
        assert_int_equal(check_seal(&entry), RESULT_OK);
        assert_int_equal(entry, ENTRIES);
        assert_int_equal(renew(&entry), i ? RESULT_MISSING : RESULT_OK);
    }
    assert_non_null(strstr(err.text, "entry 41 of the audit log"));
    drop_keys();
}

static void a_kept_entry_that_cannot_be_read_is_none(void **state) {
    (void)state;
    int64_t entry;
    static const char *const lines[] = {
        "", "x", ":", "40", "0:aa", "-1:aa", "99999999999999999999:aa"};
    make_keys("keys");
    for (size_t i = 0; i < sizeof lines / sizeof *lines; i++) {
        put_file("keys/audit.head", lines[i], strlen(lines[i]));
        assert_int_equal(renew(&entry), RESULT_FORMAT);
        assert_non_null(strstr(err.text, "audit.head"));
    }
    drop_keys();
}

int main(void) {
    const struct CMUnitTest tests[] = {
#define TEST(f) cmocka_unit_test_setup_teardown(f, begin, store_folder_end)
        TEST(what_was_written_is_whole),
        TEST(others_write_while_it_is_verified),
        TEST(the_first_hash_is_that_of_its_fields),
        TEST(every_change_is_found_and_its_entry_named),
        TEST(the_end_is_signed_and_signed_again_when_there_is_more),
        TEST(a_log_that_was_written_again_does_not_fit_its_signature),
        TEST(a_signature_of_somebody_else_is_none),
        TEST(what_was_signed_does_not_move_to_another_entry),
        TEST(what_is_cut_off_is_missed_with_or_without_its_signature),
        TEST(a_backup_that_is_put_back_is_whole_and_an_older_one_is_noticed),
        TEST(a_kept_entry_that_cannot_be_read_is_none),
    };
    return cmocka_run_group_tests_name("store_audit", tests, NULL, NULL);
}
