// The connection with NATS JetStream. The one file of the program that speaks with libnats.
//
// What it keeps there: a bucket with the keys of the lease, and a stream with the journals of
// stations. They are made where they are missing.
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

void jet_publish(struct jet *jet, uint64_t id, const struct jet_message *message);
// Removes the messages of a subject before the sequence; 0: all. Not answered, and tried once.
void jet_purge(struct jet *jet, const char *subject, uint64_t before);

// Calls `take` for each message of a subject in order, up to this sequence (0: the last that is
// there). It waits; RESULT_TIMEOUT: NATS does not answer. RESULT_MISSING: there is none.
enum result jet_read(struct jet *jet, const char *subject, uint64_t until,
                     bool (*take)(void *user, const struct jet_message *message, uint64_t sequence),
                     void *user, struct error *err);

#define JET_JOURNAL "arthron.journal." // subjects: and the station's name as a token
// A name as a token of a subject or key: what is not a letter, digit, - or _ becomes =XX.
#define JET_TOKEN_SIZE (3 * SERVER_NAME_SIZE)
void jet_token(const char *name, char out_token[JET_TOKEN_SIZE]);
bool jet_name(const char *token, char out_name[SERVER_NAME_SIZE]); // false: it is none
