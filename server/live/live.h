// What pages see: what happens in the sessions, and what happened in recorded sessions, as the
// batches of /live (PROTOCOL.md, "Live"). Whoever serves pages asks for the next batch of a viewer
// when its page can take one; what a page does not take in time it never gets, but the newest.
//
// All but live_server_create, _destroy and _bell is for one thread, that of the pages, and waits
// for nothing but copies. Commands and recorded sessions have threads of the live's own.
#pragma once

#include "sessions/sessions.h"
#include "wire/wire.h"

#define LIVE_VIEWERS_MAX 64
#define LIVE_BATCH_MAX 65536 // what a batch takes

struct live_server;
struct viewer;

// Who looks on. Instructors see and command all; technicians see all that is live, and may list and
// show; trainees see their own sessions.
struct live_account {
    char name[64];
    char role[16]; // "instructor", "technician", "trainee"
    char trainee[64];
};

struct live_config {
    void *user;
    // Whether the account may see a recorded session (32 hexadecimal digits). Out of a thread that
    // may wait for the records.
    bool (*allowed)(void *user, const struct live_account *account, const char *session);
    // With a page that takes nothing of a recorded session while others wait for theirs; 0: 30 s.
    int patience_ms;
};

struct live_server *live_server_create(struct sessions *sessions, const struct live_config *config);
// Before the sessions, and after whoever serves pages. NULL inside is fine.
void live_server_destroy(struct live_server **live);

// From now on `ring` is called, from any thread and at any time, when some viewer may have
// something; it must not wait. NULL: no longer, and no call is under way when this returns.
void live_server_on_news(struct live_server *live, void (*ring)(void *user), void *user);

// NULL where there is no place.
struct viewer *live_server_join(struct live_server *live, const struct live_account *account);
void live_server_leave(struct live_server *live, struct viewer *viewer);

// False where a page says what it may not, or too much.
bool live_server_take(struct live_server *live, struct viewer *viewer, const arthron_Page *message);

// The next batch: an encoded LiveBatch of at most `size` bytes, at least LIVE_BATCH_MAX; 0:
// there is nothing now. *out_next_ns: when to ask again, where the bell does not ring before.
size_t live_server_batch(struct live_server *live, struct viewer *viewer, int64_t now_ns,
                         uint8_t *out, size_t size, int64_t *out_next_ns);
