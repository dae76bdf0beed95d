#include "cluster/shared_records.h"

#include "base/chance.h"
#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "cluster/records_key.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>
#include <xxhash.h>

#define COPIES JET_RECORDS "copy"
#define WAIT_MS 100
#define AGAIN_NS (500 * NS_PER_MS)
#define SILENT_NS (10 * NS_PER_S) // a follower that hears nothing for so long may be dead
#define PATIENCE_MS 5000
#define BEFORE_COPY ((size_t)8 << 20) // bytes of changes
#define COPY_AGAIN_NS (30 * NS_PER_S)
#define PIECES_MAX 65536 // of a change

struct shared_records {
    struct jet *jet;
    char path[PATH_MAX];
    struct store_member self;
    char changes[sizeof JET_RECORDS + STORE_ID_MAX]; // the subject of this order
    pthread_t thread;
    atomic_bool ends;
    // The thread's own:
    char fresh[STORE_ID_MAX]; // the name of a file that joins anew; empty: there is none
    struct jet_follower *follower;
    unsigned generation; // of the connection that it follows by
    int64_t heard_ns;
    int64_t published; // number of the last own change that is in the order, as far as is known
    bool lacks_some;   // changes: a copy is to be taken, whatever its place
    bool has_erased;
    size_t since_copy; // bytes of changes
    int64_t copy_after_ns;
    bool needs_copy; // there is none yet
    bool failing;
};

static void tell_result(struct shared_records *r, enum result result, const struct error *err) {
    bool failing = result != RESULT_OK;
    if (failing && !r->failing)
        log_warning("cluster", "the records are not shared for now: %s", err->text);
    else if (!failing && r->failing)
        log_info("cluster", "the records are shared again");
    r->failing = failing;
}

static enum result open_store(struct shared_records *r, struct store **out, struct error *err) {
    return store_open(r->path, STORE_MAKE, "server", out, err);
}

static enum result read_share(struct shared_records *r, struct store_share *out,
                              struct error *err) {
    struct store *store;
    enum result result = open_store(r, &store, err);
    if (result == RESULT_OK)
        result = store_share(store, out, err);
    store_close(&store);
    return result;
}

// ---- the key ------------------------------------------------------------------------------------

// *out_revision: 0, if there is none; the key is a new one then.
static enum result read_key(struct shared_records *r, struct records_key *out,
                            uint64_t *out_revision, struct error *err) {
    char *text = alloc(1, RECORDS_KEY_SIZE);
    enum result result =
        jet_read_key(r->jet, RECORDS_KEY, text, RECORDS_KEY_SIZE, out_revision, err);
    if (result == RESULT_OK) {
        result = records_key_read(text, out, err);
    } else if (result == RESULT_MISSING) {
        *out_revision = 0;
        records_key_begin(out);
        result = RESULT_OK;
    }
    free(text);
    return result;
}

static enum result write_key(struct shared_records *r, const struct records_key *key,
                             uint64_t replaces, struct error *err) {
    char *text = alloc(1, RECORDS_KEY_SIZE);
    records_key_text(key, text);
    enum result result = jet_replace_key(r->jet, RECORDS_KEY, replaces, text, err);
    free(text);
    return result;
}

// ---- a copy of all records ----------------------------------------------------------------------

static void copy_path(const struct shared_records *r, char out[PATH_MAX + 16]) {
    snprintf(out, PATH_MAX + 16, "%s.copy", r->path);
}

static enum result publish_copy(struct shared_records *r, const uint8_t *bytes,
                                struct records_key *key, struct error *err) {
    enum result result = RESULT_OK;
    for (uint64_t done = 0, number = 1; result == RESULT_OK && done < key->size; number++) {
        uint64_t left = key->size - done, sequence;
        struct jet_message message = {.subject = COPIES,
                                      .token = key->token,
                                      .number = number,
                                      .kind = "copy",
                                      .data = bytes + done,
                                      .size = left < JET_PART_MAX ? left : JET_PART_MAX};
        result = jet_publish_now(r->jet, &message, &sequence, err);
        if (number == 1)
            key->first = sequence;
        done += message.size;
    }
    return result;
}

static enum result read_file(const char *path, uint8_t **out_bytes, size_t *out_size,
                             struct error *err) {
    FILE *file = fopen(path, "re");
    long size = -1;
    *out_bytes = NULL;
    if (file && !fseek(file, 0, SEEK_END) && (size = ftell(file)) > 0 &&
        !fseek(file, 0, SEEK_SET)) {
        *out_bytes = alloc(1, (size_t)size);
        if (fread(*out_bytes, 1, (size_t)size, file) != (size_t)size)
            size = -1;
    }
    *out_size = size > 0 ? (size_t)size : 0;
    if (file)
        fclose(file);
    return size > 0 ? RESULT_OK : fail(err, RESULT_IO, "%s: it cannot be read", path);
}

static enum result make_copy(struct shared_records *r, int64_t *out_place, uint8_t **out_bytes,
                             size_t *out_size, struct error *err) {
    char path[PATH_MAX + 16];
    struct store *store;
    copy_path(r, path);
    *out_bytes = NULL;
    enum result result = open_store(r, &store, err);
    if (result == RESULT_OK)
        result = store_share_copy(store, path, out_place, err);
    store_close(&store);
    if (result == RESULT_OK)
        result = read_file(path, out_bytes, out_size, err);
    unlink(path);
    return result;
}

// NATS forgets what the new copy has; what was erased, it overwrites. A server that comes a little
// late finds the changes behind the copy before.
static enum result forget(struct shared_records *r, const struct records_key *now, uint64_t before,
                          struct error *err) {
    struct store *store;
    if (!r->has_erased) {
        jet_purge(r->jet, r->changes, before + 1);
        jet_purge(r->jet, COPIES, now->first);
        return RESULT_OK;
    }
    enum result result = jet_erase(r->jet, r->changes, now->place + 1, err);
    if (result == RESULT_OK)
        result = jet_erase(r->jet, COPIES, now->first, err);
    if (result != RESULT_OK)
        return result;
    result = open_store(r, &store, err);
    if (result == RESULT_OK)
        result = store_forgotten(store, err);
    store_close(&store);
    r->has_erased = false;
    return result;
}

// RESULT_REFUSED: another server has given one meanwhile.
static enum result put_copy(struct shared_records *r, int64_t place, const uint8_t *bytes,
                            size_t size, struct records_key *key, uint64_t revision,
                            struct error *err) {
    uint64_t before = key->place;
    if (key->size && (uint64_t)place < before)
        return fail(err, RESULT_REFUSED, "a newer copy of the records is with NATS");
    key->place = (uint64_t)place;
    key->size = size;
    key->hash = XXH3_64bits(bytes, size);
    chance_fill(&key->token, sizeof key->token);
    enum result result = publish_copy(r, bytes, key, err);
    if (result == RESULT_OK)
        result = write_key(r, key, revision, err);
    if (result == RESULT_OK)
        result = forget(r, key, before, err);
    return result;
}

// The key is read before the copy is made, so that none takes the place of a newer one.
static enum result give_copy(struct shared_records *r, struct error *err) {
    struct records_key key;
    uint64_t revision;
    uint8_t *bytes = NULL;
    size_t size = 0;
    int64_t place = 0;
    enum result result = read_key(r, &key, &revision, err);
    if (result == RESULT_OK)
        result = make_copy(r, &place, &bytes, &size, err);
    if (result == RESULT_OK)
        result = put_copy(r, place, bytes, size, &key, revision, err);
    free(bytes);
    if (result == RESULT_OK)
        log_info("cluster", "a copy of the records is with NATS: %zu bytes", size);
    return result;
}

static bool wants_copy(const struct shared_records *r) {
    return (r->needs_copy || r->has_erased || r->since_copy > BEFORE_COPY) &&
           clock_now_ns() >= r->copy_after_ns;
}

// The changes go on without it.
static void renew_copy(struct shared_records *r) {
    struct error err;
    enum result result = give_copy(r, &err);
    r->copy_after_ns = clock_now_ns() + (result == RESULT_OK ? 0 : COPY_AGAIN_NS);
    if (result != RESULT_OK && result != RESULT_REFUSED) {
        log_warning("cluster", "no copy of the records is made for now: %s", err.text);
        return;
    }
    r->since_copy = 0;
    r->needs_copy = false;
}

static enum result fetch_copy(struct shared_records *r, const struct records_key *key,
                              uint8_t *bytes, struct error *err) {
    struct jet_follower *follower;
    uint64_t done = 0, sequence;
    enum result result = jet_follow(r->jet, COPIES, key->first, &follower, err);
    while (result == RESULT_OK && done < key->size) {
        struct jet_message message;
        result = jet_follow_next(follower, PATIENCE_MS, &message, &sequence, err);
        if (result == RESULT_MISSING)
            result = fail(err, RESULT_TIMEOUT, "the copy of the records at NATS is not whole");
        if (result != RESULT_OK || message.token != key->token)
            continue;
        if (message.size > key->size - done)
            result = fail(err, RESULT_FORMAT, "the copy of the records at NATS is too long");
        else
            memcpy(bytes + done, message.data, message.size);
        done += message.size;
    }
    jet_follow_end(&follower);
    if (result == RESULT_OK && XXH3_64bits(bytes, key->size) != key->hash)
        result = fail(err, RESULT_FORMAT, "the copy of the records at NATS is damaged");
    return result;
}

// For this user alone.
static enum result write_file(const char *path, const uint8_t *bytes, size_t size,
                              struct error *err) {
    unlink(path);
    int fd = open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
    ssize_t done = fd >= 0 ? 0 : -1;
    for (size_t at = 0; done >= 0 && at < size; at += (size_t)done)
        done = write(fd, bytes + at, size - at);
    int fault = errno;
    if (fd >= 0)
        close(fd);
    return done >= 0 ? RESULT_OK : fail(err, RESULT_IO, "%s: %s", path, strerror(fault));
}

static enum result take_copy(struct shared_records *r, const struct records_key *key,
                             struct error *err) {
    char path[PATH_MAX + 16], aside[STORE_TEXT_MAX] = "";
    uint8_t *bytes = alloc(1, key->size);
    copy_path(r, path);
    enum result result = fetch_copy(r, key, bytes, err);
    if (result == RESULT_OK)
        result = write_file(path, bytes, key->size, err);
    free(bytes);
    if (result == RESULT_OK)
        result = store_share_load(path, r->path, &r->self, aside, err);
    unlink(path);
    if (result == RESULT_OK && aside[0])
        log_warning("cluster",
                    "%s: the records are those that the servers share from now on; this server's "
                    "own are kept in %s",
                    r->path, aside);
    r->lacks_some = r->lacks_some && result != RESULT_OK;
    return result;
}

// ---- joining ------------------------------------------------------------------------------------

// This server's records become those of all: it is the first.
static enum result found(struct shared_records *r, struct error *err) {
    struct store *store;
    enum result result = open_store(r, &store, err);
    if (result == RESULT_OK)
        result = store_share_begin(store, &r->self, err);
    store_close(&store);
    return result;
}

// A file that was among them keeps its slot; any other one gets a new one.
static enum result find_slot(struct shared_records *r, const struct store_share *share,
                             struct records_key *key, struct error *err) {
    uint64_t revision;
    enum result result = read_key(r, key, &revision, err);
    if (result != RESULT_OK)
        return result;
    bool is_there =
        !strcmp(share->self.server, r->self.server) && !strcmp(share->self.order, key->order);
    if (!is_there && !r->fresh[0])
        records_key_name(r->fresh);
    int before = key->server_count;
    snprintf(r->self.file, sizeof r->self.file, "%s", is_there ? share->self.file : r->fresh);
    snprintf(r->self.order, sizeof r->self.order, "%s", key->order);
    snprintf(r->changes, sizeof r->changes, JET_RECORDS "%s", key->order);
    r->self.slot = records_key_slot(key, r->self.server, r->self.file);
    if (r->self.slot < 0)
        return fail(err, RESULT_LIMIT, "%d files of records are shared already", STORE_SERVERS_MAX);
    return key->server_count == before ? RESULT_OK : write_key(r, key, revision, err);
}

static enum result join(struct shared_records *r, struct records_key *key, struct error *err) {
    struct store_share share;
    enum result result = read_share(r, &share, err);
    if (result == RESULT_OK)
        result = find_slot(r, &share, key, err);
    if (result != RESULT_OK)
        return result;
    bool is_member = store_is_member(&share, &r->self);
    bool is_late = key->size && (r->lacks_some || key->place > (uint64_t)share.applied);
    if (is_member && !is_late)
        return RESULT_OK;
    if (key->size)
        result = take_copy(r, key, err);
    else if (r->self.slot == 0)
        result = found(r, err);
    else
        result = fail(err, RESULT_TIMEOUT, "server %s has not given its records yet",
                      key->servers[0].name);
    if (result == RESULT_OK)
        r->fresh[0] = '\0';
    return result;
}

// A server that was among them before need not wait.
static enum result was_there(struct shared_records *r, bool *out_was, struct error *err) {
    struct store_share share = {0};
    enum result result = read_share(r, &share, err);
    *out_was =
        result == RESULT_OK && share.self.order[0] && !strcmp(share.self.server, r->self.server);
    if (*out_was)
        r->self = share.self;
    return result;
}

static void pause_for(int64_t ns) {
    nanosleep(&(struct timespec){ns / NS_PER_S, ns % NS_PER_S}, NULL);
}

static enum result join_first(struct shared_records *r, const atomic_bool *ends,
                              struct error *err) {
    struct records_key key;
    bool was = false;
    enum result result = was_there(r, &was, err);
    if (result != RESULT_OK || was)
        return result;
    while ((result = join(r, &key, err)) == RESULT_TIMEOUT || result == RESULT_REFUSED) {
        tell_result(r, result, err);
        if (atomic_load(ends))
            return fail(err, RESULT_CLOSED, "the server ends while it waits for the records");
        pause_for(AGAIN_NS);
    }
    r->failing = false;
    return result;
}

// ---- the order ----------------------------------------------------------------------------------

static enum result begin_to_follow(struct shared_records *r, struct error *err) {
    struct records_key key;
    struct store_share share;
    uint64_t last = 0;
    unsigned generation = jet_generation(r->jet);
    enum result result = join(r, &key, err);
    if (result == RESULT_OK)
        result = read_share(r, &share, err);
    if (result == RESULT_OK)
        result = jet_last_of_records(r->jet, &last, err);
    if (result == RESULT_OK && last < (uint64_t)share.applied)
        result = fail(err, RESULT_FORMAT,
                      "NATS has lost the changes of the records: see docs/SCALE.md, \"Records\"");
    if (result == RESULT_OK)
        result = jet_follow(r->jet, r->changes, (uint64_t)share.applied + 1, &r->follower, err);
    if (result != RESULT_OK)
        return result;
    if (generation != r->generation) // each server passes over what it has
        r->published = 0;
    r->generation = generation;
    r->needs_copy = !key.size;
    r->heard_ns = clock_now_ns();
    return RESULT_OK;
}

static void note_drop(struct shared_records *r, const struct store_change *change) {
    log_warning("cluster", "records: change %lld of %s contradicts an earlier one, and is dropped",
                (long long)change->number,
                change->slot == r->self.slot ? "this server" : "another server");
}

// This file joins anew, as another one.
static void leave_order(struct shared_records *r) {
    struct store *store;
    struct error err;
    log_warning("cluster", "%s: this is an older copy of the records: they are fetched again",
                r->path);
    enum result result = open_store(r, &store, &err);
    if (result == RESULT_OK)
        result = store_share_end(store, &err);
    store_close(&store);
    if (result != RESULT_OK)
        log_error("cluster", "%s", err.text);
}

static enum result apply(struct shared_records *r, const struct jet_message *message,
                         uint64_t sequence, struct error *err) {
    const struct store_change change = {.slot = (int)(message->token % STORE_SERVERS_MAX),
                                        .number = (int64_t)(message->number / PIECES_MAX),
                                        .piece = (int)(message->number % PIECES_MAX),
                                        .goes_on = !strcmp(message->kind, "more"),
                                        .bytes = message->data,
                                        .size = message->size};
    struct store *store;
    bool dropped = false;
    if ((int)(message->token / STORE_SERVERS_MAX) > store_table_version())
        return fail(err, RESULT_VERSION,
                    "another server has newer tables: upgrade this server, too");
    enum result result = open_store(r, &store, err);
    if (result == RESULT_OK)
        result = store_apply(store, &change, (int64_t)sequence, &dropped, err);
    store_close(&store);
    r->lacks_some = r->lacks_some || result == RESULT_MISSING;
    if (result == RESULT_REFUSED)
        leave_order(r);
    if (result == RESULT_OK && dropped)
        note_drop(r, &change);
    r->since_copy += change.size;
    return result;
}

// All that is there, or comes in a moment.
static enum result take_changes(struct shared_records *r, struct error *err) {
    struct jet_message message;
    uint64_t sequence;
    enum result result;
    int wait_ms = WAIT_MS;
    while ((result = jet_follow_next(r->follower, wait_ms, &message, &sequence, err)) ==
           RESULT_OK) {
        r->heard_ns = clock_now_ns();
        result = apply(r, &message, sequence, err);
        if (result != RESULT_OK)
            return result == RESULT_MISSING ? RESULT_FORMAT : result;
        wait_ms = 1;
    }
    return result == RESULT_MISSING ? RESULT_OK : result;
}

// The version of the tables, and the slot behind it.
static uint64_t token_of(const struct shared_records *r) {
    return (uint64_t)store_table_version() * STORE_SERVERS_MAX + (uint64_t)r->self.slot;
}

// In pieces: the number of the change, and that of the piece.
static enum result publish_one(struct shared_records *r, int64_t number, const uint8_t *bytes,
                               size_t size, struct error *err) {
    enum result result = RESULT_OK;
    size_t done = 0;
    for (uint64_t piece = 0; result == RESULT_OK && done < size; piece++) {
        size_t left = size - done, part = left < JET_PART_MAX ? left : JET_PART_MAX;
        uint64_t sequence;
        const struct jet_message message = {.subject = r->changes,
                                            .token = token_of(r),
                                            .number = (uint64_t)number * PIECES_MAX + piece,
                                            .kind = part < left ? "more" : "change",
                                            .data = bytes + done,
                                            .size = part};
        result = jet_publish_now(r->jet, &message, &sequence, err);
        done += part;
    }
    return result;
}

// *out_some: there may be more.
static enum result publish_next(struct shared_records *r, bool *out_some, struct error *err) {
    struct store *store;
    uint8_t *bytes = NULL;
    size_t size = 0;
    int64_t number = 0;
    enum result result = open_store(r, &store, err);
    if (result == RESULT_OK)
        result = store_has_erased(store, &r->has_erased, err);
    if (result == RESULT_OK)
        result = store_own_change(store, r->published, &number, &bytes, &size, err);
    store_close(&store);
    *out_some = result == RESULT_OK;
    if (result == RESULT_OK)
        result = publish_one(r, number, bytes, size, err);
    free(bytes);
    if (result == RESULT_OK)
        r->published = number;
    return result == RESULT_MISSING ? RESULT_OK : result;
}

// Whether changes are on their way: a copy would lack them.
static bool has_waiting(struct shared_records *r) {
    struct store *store;
    uint8_t *bytes = NULL;
    size_t size;
    int64_t number;
    bool has = open_store(r, &store, NULL) != RESULT_OK ||
               store_own_change(store, 0, &number, &bytes, &size, NULL) != RESULT_MISSING;
    store_close(&store);
    free(bytes);
    return has;
}

static enum result publish_changes(struct shared_records *r, struct error *err) {
    bool some = true;
    enum result result = RESULT_OK;
    while (result == RESULT_OK && some)
        result = publish_next(r, &some, err);
    return result;
}

// What is in the order comes first: it tells whether this file may add to it.
static enum result turn_records(struct shared_records *r, struct error *err) {
    enum result result = RESULT_OK;
    if (r->follower &&
        (clock_now_ns() - r->heard_ns > SILENT_NS || r->generation != jet_generation(r->jet)))
        jet_follow_end(&r->follower);
    if (!r->follower)
        result = begin_to_follow(r, err);
    if (result == RESULT_OK)
        result = take_changes(r, err);
    if (result == RESULT_OK)
        result = publish_changes(r, err);
    if (result == RESULT_OK && wants_copy(r) && !has_waiting(r))
        renew_copy(r);
    return result;
}

static void *run(void *argument) {
    struct shared_records *r = argument;
    while (!atomic_load(&r->ends)) {
        struct error err;
        enum result result = turn_records(r, &err);
        tell_result(r, result, &err);
        if (result == RESULT_OK)
            continue;
        jet_follow_end(&r->follower);
        pause_for(AGAIN_NS);
    }
    if (r->follower)
        publish_changes(r, NULL);
    jet_follow_end(&r->follower);
    return NULL;
}

// ---- begin and end ------------------------------------------------------------------------------

enum result shared_records_create(struct jet *jet, const char *path, const char *name,
                                  const atomic_bool *ends, struct shared_records **out_records,
                                  struct error *err) {
    struct shared_records *r = alloc(1, sizeof *r);
    r->jet = jet;
    snprintf(r->path, sizeof r->path, "%s", path);
    snprintf(r->self.server, sizeof r->self.server, "%s", name);
    r->generation = jet_generation(jet) - 1; // none is followed yet
    enum result result = join_first(r, ends, err);
    if (result == RESULT_OK) {
        int failed = pthread_create(&r->thread, NULL, run, r);
        NEED(!failed, "thread");
    } else {
        free(r);
        r = NULL;
    }
    *out_records = r;
    return result;
}

void shared_records_destroy(struct shared_records **records) {
    struct shared_records *r = *records;
    if (!r)
        return;
    atomic_store(&r->ends, true);
    pthread_join(r->thread, NULL);
    free(r);
    *records = NULL;
}
