// The connection with NATS JetStream. The one file of the program that speaks with libnats.
//
// What it keeps there: a bucket with the keys of the lease, a stream with the journals of stations,
// and one with what the servers' records share. They are made where they are missing.
#pragma once

#include "base/result.h"
#include "cluster/ownership.h"

#include <stddef.h>

#define JET_SERVERS_MAX 8
#define JET_TEXT_SIZE 256
#define JET_PART_MAX ((size_t)512 << 10) // bytes of a message: NATS takes 1 MiB as it is installed

struct jet_settings {
    char name[SERVER_NAME_SIZE]; // of this server, for the lists of NATS
    int server_count;
    char servers[JET_SERVERS_MAX][JET_TEXT_SIZE]; // nats:// or tls://HOST:PORT
    char authority[JET_TEXT_SIZE];                // files of certificates and a key, PEM; or empty
    char certificate[JET_TEXT_SIZE], key[JET_TEXT_SIZE];
    char user[SERVER_NAME_SIZE], password[JET_TEXT_SIZE]; // the file with it; or empty
    int replicas;                                         // of each stream: 1, 3 or 5
};

// Called on threads of the library and of the jet; must not wait, and must not call the jet.
struct jet_handler {
    void *user;
    void (*answered)(void *user, uint64_t id, enum write_answer answer, uint64_t revision);
    void (*saw)(void *user, const char *key, const char *value, size_t size, uint64_t revision);
    void (*connected)(void *user, bool is_connected);
};

struct jet;

// Connects in the background, for as long as it takes. RESULT_MISSING, RESULT_INVALID: a file or an
// address that cannot be used.
enum result jet_create(const struct jet_settings *settings, const struct jet_handler *handler,
                       struct jet **out_jet, struct error *err);
void jet_destroy(struct jet **jet); // NULL inside is fine
// Once no jet is left: waits for the threads of the library.
void jet_end_library(void);

// Calls `take` for each key of the lease that is there, over a connection of its own. It waits, for
// some seconds at most. The error says also that NATS does not answer.
enum result jet_look(const struct jet_settings *settings,
                     void (*take)(void *user, const char *key, const char *value, size_t size),
                     void *user, struct error *err);

// A key of the lease. An answer follows in any case. `value`: text.
void jet_write_key(struct jet *jet, uint64_t id, const char *key, uint64_t replaces,
                   const char *value);

// A message of a stream; an answer follows, with its sequence as the revision. `number`: with the
// subject it names the message, so that one that is sent twice is kept once.
struct jet_message {
    const char *subject;
    uint64_t token, number;
    const char *kind; // a word
    const void *data;
    size_t size; // at most JET_PART_MAX
};

// A copy of a message, ready to be sent. Sending it gives it away, and may wait where NATS is slow.
struct jet_letter;

struct jet_letter *jet_pack(const struct jet_message *message);
void jet_send(struct jet *jet, uint64_t id, struct jet_letter *letter);
// Packs a message, sends it and waits until it is kept. RESULT_TIMEOUT: it may be kept or not.
enum result jet_publish_now(struct jet *jet, const struct jet_message *message,
                            uint64_t *out_sequence, struct error *err);
// Removes the messages of a subject before the sequence; 0: all. Not answered, and tried once.
void jet_purge(struct jet *jet, const char *subject, uint64_t before);

// The same one by one, and NATS overwrites them on its disks. It waits.
enum result jet_erase(struct jet *jet, const char *subject, uint64_t before, struct error *err);

// Calls `take` for each message of a subject in order, up to this sequence (0: the last that is
// there). It waits; RESULT_TIMEOUT: NATS does not answer. RESULT_MISSING: there is none.
enum result jet_read(struct jet *jet, const char *subject, uint64_t until,
                     bool (*take)(void *user, const struct jet_message *message, uint64_t sequence),
                     void *user, struct error *err);

// Reads a subject on and on.
struct jet_follower;

// From this sequence, which is at most one behind the last of the stream. RESULT_TIMEOUT: NATS does
// not answer.
enum result jet_follow(struct jet *jet, const char *subject, uint64_t from,
                       struct jet_follower **out_follower, struct error *err);
// The next message; its data live until the next call. RESULT_MISSING: none came. RESULT_TIMEOUT:
// follow it anew. A follower that was cut off for long gets nothing more, and cannot tell.
enum result jet_follow_next(struct jet_follower *follower, int wait_ms,
                            struct jet_message *out_message, uint64_t *out_sequence,
                            struct error *err);
void jet_follow_end(struct jet_follower **follower); // NULL inside is fine
// Counts how often NATS answered anew. What was followed before is to be followed anew.
unsigned jet_generation(const struct jet *jet);
// The sequence of the last message of the records' stream; 0: none was ever there.
enum result jet_last_of_records(struct jet *jet, uint64_t *out_sequence, struct error *err);

// A key of the bucket, at once. RESULT_MISSING: there is none. RESULT_LIMIT: it is too long.
enum result jet_read_key(struct jet *jet, const char *key, char *out_value, size_t size,
                         uint64_t *out_revision, struct error *err);
// replaces: a revision, or 0. RESULT_REFUSED: another revision is there.
enum result jet_replace_key(struct jet *jet, const char *key, uint64_t replaces, const char *value,
                            struct error *err);

#define JET_JOURNAL "arthron.journal." // subjects: and the station's name as a token
#define JET_RECORDS "arthron.records." // subjects of another stream
// A name as a token of a subject or key: what is not a letter, digit, - or _ becomes =XX.
#define JET_TOKEN_SIZE (3 * SERVER_NAME_SIZE)
void jet_token(const char *name, char out_token[JET_TOKEN_SIZE]);
bool jet_name(const char *token, char out_name[SERVER_NAME_SIZE]); // false: it is none
