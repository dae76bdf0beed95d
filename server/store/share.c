#include "store/share.h"

#include "base/check.h"
#include "store/change.h"
#include "store/schema.h"
#include "store/text.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

// ---- this server's place ------------------------------------------------------------------------

static void take_share(void *user, const struct store_cell *cells, int count) {
    struct store_share *share = user;
    CHECK(count == 5);
    snprintf(share->self.server, sizeof share->self.server, "%s", cells[0].text);
    snprintf(share->self.order, sizeof share->self.order, "%s", cells[1].text);
    snprintf(share->self.file, sizeof share->self.file, "%s", cells[2].text);
    share->self.slot = (int)cells[3].integer;
    share->applied = cells[4].integer;
}

enum result store_share(struct store *store, struct store_share *out, struct error *err) {
    sqlite3_stmt *statement;
    *out = (struct store_share){0};
    enum result result = store_prepare(
        store, "SELECT server, shared_order, file, slot, applied FROM share", &statement, err, "");
    return result == RESULT_OK ? store_each_row(store, statement, take_share, out, err) : result;
}

int store_table_version(void) {
    return schema_version;
}

bool store_is_member(const struct store_share *share, const struct store_member *member) {
    return share->self.slot == member->slot && !strcmp(share->self.server, member->server) &&
           !strcmp(share->self.order, member->order) && !strcmp(share->self.file, member->file);
}

const char share_end[] =
    "UPDATE session SET server = '' WHERE server = (SELECT server FROM share);"
    "UPDATE part SET server = '' WHERE server = (SELECT server FROM share);"
    "UPDATE share SET server = '', shared_order = '', file = '', applied = 0, erased = 0;"
    "DELETE FROM change; DELETE FROM removed; DELETE FROM sender;"
    "DELETE FROM sqlite_sequence WHERE name = 'change';";

enum result store_share_end(struct store *store, struct error *err) {
    enum result result = store_run(store, "BEGIN IMMEDIATE", err);
    if (result != RESULT_OK)
        return result;
    return store_end(store, store_run(store, share_end, err), err);
}

// They had another order before, perhaps, which is over.
enum result store_share_begin(struct store *store, const struct store_member *self,
                              struct error *err) {
    CHECK(self->slot >= 0 && self->slot < STORE_SERVERS_MAX);
    enum result result = text_check(self->server, "server's name", STORE_NAME_MAX, err);
    if (result == RESULT_OK)
        result = store_run(store, "BEGIN IMMEDIATE", err);
    if (result != RESULT_OK)
        return result;
    result = store_run(store, share_end, err);
    if (result == RESULT_OK)
        result = store_do(store, "UPDATE session SET server = ?1 WHERE server = ''", err, "t",
                          self->server);
    if (result == RESULT_OK)
        result = store_do(store, "UPDATE part SET server = ?1 WHERE server = ''", err, "t",
                          self->server);
    if (result == RESULT_OK)
        result = store_do(
            store, "UPDATE share SET server = ?, shared_order = ?, file = ?, slot = ?, step = ?",
            err, "tttii", self->server, self->order, self->file, (int64_t)self->slot,
            (int64_t)STORE_SERVERS_MAX);
    return store_end(store, result, err);
}

// ---- what is not in the order yet ---------------------------------------------------------------

enum result store_own_change(struct store *store, int64_t behind, int64_t *out_number,
                             uint8_t **out_bytes, size_t *out_size, struct error *err) {
    sqlite3_stmt *statement;
    *out_bytes = NULL;
    enum result result = store_prepare(
        store, "SELECT number, bytes FROM change WHERE number > ? ORDER BY number LIMIT 1",
        &statement, err, "i", behind);
    if (result != RESULT_OK)
        return result;
    int code = sqlite3_step(statement);
    if (code == SQLITE_ROW) {
        *out_number = sqlite3_column_int64(statement, 0);
        *out_size = (size_t)sqlite3_column_bytes(statement, 1);
        *out_bytes = alloc(1, *out_size + 1);
        memcpy(*out_bytes, sqlite3_column_blob(statement, 1), *out_size);
    } else {
        result = code == SQLITE_DONE ? RESULT_MISSING : store_failed(store, code, err);
    }
    sqlite3_reset(statement);
    return result;
}

// Of the last change of this server that is in the order.
#define OWN_NUMBER "ifnull((SELECT number FROM sender WHERE sender.slot = share.slot), 0)"

enum result store_has_erased(struct store *store, bool *out_has, struct error *err) {
    int64_t has = 0;
    enum result result = store_find(
        store, "SELECT erased > 0 AND erased <= " OWN_NUMBER " FROM share", &has, err, "");
    *out_has = has != 0;
    return result;
}

enum result store_forgotten(struct store *store, struct error *err) {
    return store_run(store, "UPDATE share SET erased = 0 WHERE erased <= " OWN_NUMBER, err);
}

// ---- applying -----------------------------------------------------------------------------------

struct sender {
    int64_t number; // of its last change that was applied
    int64_t pieces; // of the next one that are there
};

static void take_sender(void *user, const struct store_cell *cells, int count) {
    struct sender *sender = user;
    CHECK(count == 2);
    sender->number = cells[0].integer;
    sender->pieces = cells[1].integer;
}

static enum result read_sender(struct store *store, int slot, struct sender *out,
                               struct error *err) {
    sqlite3_stmt *statement;
    *out = (struct sender){0};
    enum result result = store_prepare(store, "SELECT number, pieces FROM sender WHERE slot = ?",
                                       &statement, err, "i", (int64_t)slot);
    return result == RESULT_OK ? store_each_row(store, statement, take_sender, out, err) : result;
}

static enum result run_bytes(struct store *store, const char *sql,
                             const struct store_change *change, struct error *err) {
    sqlite3_stmt *statement;
    enum result result = store_prepare(store, sql, &statement, err, "i", (int64_t)change->slot);
    if (result != RESULT_OK)
        return result;
    int code = sqlite3_bind_blob64(statement, 2, change->bytes, change->size, SQLITE_STATIC);
    if (code == SQLITE_OK)
        code = sqlite3_step(statement);
    sqlite3_reset(statement);
    sqlite3_clear_bindings(statement);
    return code == SQLITE_DONE ? RESULT_OK : store_failed(store, code, err);
}

// Piece 0 begins anew: the server may have been interrupted between two pieces.
static enum result keep_piece(struct store *store, const struct store_change *change,
                              struct error *err) {
    if (change->piece == 0)
        return run_bytes(store,
                         "INSERT INTO sender (slot, number, pieces, begun) VALUES (?1, 0, 1, ?2) "
                         "ON CONFLICT (slot) DO UPDATE SET pieces = 1, begun = excluded.begun",
                         change, err);
    return run_bytes(store,
                     "UPDATE sender SET pieces = pieces + 1, begun = CAST(begun || ?2 AS BLOB) "
                     "WHERE slot = ?1",
                     change, err);
}

// With its last piece. The caller frees the bytes.
static enum result whole_of(struct store *store, const struct store_change *last,
                            uint8_t **out_bytes, size_t *out_size, struct error *err) {
    sqlite3_stmt *statement;
    size_t begun = 0;
    *out_bytes = NULL;
    enum result result = store_prepare(store, "SELECT begun FROM sender WHERE slot = ?", &statement,
                                       err, "i", (int64_t)last->slot);
    if (result != RESULT_OK)
        return result;
    if (last->piece && sqlite3_step(statement) == SQLITE_ROW)
        begun = (size_t)sqlite3_column_bytes(statement, 0);
    *out_size = begun + last->size;
    *out_bytes = alloc(1, *out_size + 1);
    if (begun)
        memcpy(*out_bytes, sqlite3_column_blob(statement, 0), begun);
    memcpy(*out_bytes + begun, last->bytes, last->size);
    sqlite3_reset(statement);
    return RESULT_OK;
}

static enum result apply_others(struct store *store, const struct store_change *change,
                                bool *out_dropped, struct error *err) {
    struct store_change whole = *change;
    uint8_t *bytes;
    enum result result = whole_of(store, change, &bytes, &whole.size, err);
    whole.bytes = bytes;
    int code = result == RESULT_OK ? change_do_between(store->db, &whole, out_dropped) : SQLITE_OK;
    free(bytes);
    return code == SQLITE_OK ? result : store_failed(store, code, err);
}

// It is there already, as far as it was not dropped.
static enum result pass_own(struct store *store, const struct store_change *change,
                            bool *out_dropped, struct error *err) {
    int64_t dropped = 0, newest = 0;
    enum result result = store_find(store, "SELECT seq FROM sqlite_sequence WHERE name = 'change'",
                                    &newest, err, "");
    if (result == RESULT_OK || result == RESULT_MISSING)
        result = change->number > newest
                     ? fail(err, RESULT_REFUSED, "%s: the records are an older copy of themselves",
                            store->path)
                     : store_find(store, "SELECT dropped FROM change WHERE number = ?", &dropped,
                                  err, "i", change->number);
    *out_dropped = dropped != 0;
    if (result == RESULT_OK || result == RESULT_MISSING)
        result = store_do(store, "DELETE FROM change WHERE number = ?", err, "i", change->number);
    if (result == RESULT_OK && *out_dropped)
        result = store_do(store, "UPDATE share SET dropped = dropped + 1", err, "");
    return result;
}

static enum result end_shared_change(struct store *store, int slot, int64_t number,
                                     struct error *err) {
    return store_do(store,
                    "INSERT OR REPLACE INTO sender (slot, number, pieces, begun) "
                    "VALUES (?, ?, 0, x'')",
                    err, "ii", (int64_t)slot, number);
}

static enum result apply_next(struct store *store, const struct store_change *change,
                              bool *out_dropped, struct error *err) {
    struct store_share share;
    struct sender sender;
    enum result result = store_share(store, &share, err);
    if (result == RESULT_OK)
        result = read_sender(store, change->slot, &sender, err);
    if (result != RESULT_OK || change->number <= sender.number)
        return result;
    bool own = share.self.slot == change->slot;
    if (change->number != sender.number + 1 || (!own && change->piece > sender.pieces))
        return fail(err, RESULT_MISSING, "%s: change %lld of server %d never came", store->path,
                    (long long)sender.number + 1, change->slot);
    if (own ? change->goes_on : change->piece && change->piece < sender.pieces)
        return RESULT_OK;
    if (change->goes_on)
        return keep_piece(store, change, err);
    result = own ? pass_own(store, change, out_dropped, err)
                 : apply_others(store, change, out_dropped, err);
    return result == RESULT_OK ? end_shared_change(store, change->slot, change->number, err)
                               : result;
}

// Traces of this server whose sessions another one removed.
static void take_removed(void *user, const struct store_cell *cells, int count) {
    (void)user;
    if (count == 1 && cells[0].kind == STORE_TEXT)
        unlink(cells[0].text);
}

static enum result remove_traces(struct store *store, struct error *err) {
    sqlite3_stmt *statement;
    enum result result = store_prepare(
        store,
        "SELECT trace FROM removed WHERE trace NOT IN (SELECT trace FROM session WHERE server = "
        "(SELECT server FROM share)) AND trace NOT IN (SELECT trace FROM part WHERE server = "
        "(SELECT server FROM share))",
        &statement, err, "");
    if (result == RESULT_OK)
        result = store_each_row(store, statement, take_removed, NULL, err);
    return result == RESULT_OK ? store_do(store, "DELETE FROM removed", err, "") : result;
}

enum result store_apply(struct store *store, const struct store_change *change, int64_t place,
                        bool *out_dropped, struct error *err) {
    *out_dropped = false;
    enum result result = store_run(store, "BEGIN IMMEDIATE", err); // it is no change of this server
    if (result != RESULT_OK)
        return result;
    result = apply_next(store, change, out_dropped, err);
    if (result == RESULT_OK)
        result = store_do(store, "UPDATE share SET applied = ?", err, "i", place);
    if (result == RESULT_OK && !change->goes_on)
        result = remove_traces(store, err);
    return store_end(store, result, err);
}
