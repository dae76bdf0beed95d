// The pages that look on: what happens in the hub, and what happened in recorded sessions, as the
// batches of /live (PROTOCOL.md, "Live"). Whoever serves pages asks for the next batch of a viewer
// when its page can take one; what a page does not take in time it never gets, but the newest.
//
// All but audience_create, _destroy and _bell is for one thread, that of the pages, and waits for
// nothing but copies. Commands and recorded sessions have threads of the audience's own.
#pragma once

#include "hub/hub.h"
#include "wire/wire.h"

#define AUDIENCE_VIEWERS_MAX 64
#define AUDIENCE_BATCH_MAX 65536 // what a batch takes

struct audience;
struct viewer;

// Who looks on. Instructors see and command all; technicians see all that is live, and may list and
// show; trainees see their own sessions.
struct guest {
    char name[64];
    char role[16]; // "instructor", "technician", "trainee"
    char trainee[64];
};

struct audience_config {
    void *user;
    // Whether the guest may see a recorded session (32 hexadecimal digits). Out of a thread that
    // may wait for the records.
    bool (*allowed)(void *user, const struct guest *guest, const char *session);
    // With a page that takes nothing of a recorded session while others wait for theirs; 0: 30 s.
    int patience_ms;
};

struct audience *audience_create(struct hub *hub, const struct audience_config *config);
// Before the hub, and after whoever serves pages. NULL inside is fine.
void audience_destroy(struct audience **audience);

// From now on `ring` is called, from any thread and at any time, when some viewer may have
// something; it must not wait. NULL: no longer, and no call is under way when this returns.
void audience_bell(struct audience *audience, void (*ring)(void *user), void *user);

// NULL where there is no place.
struct viewer *audience_join(struct audience *audience, const struct guest *guest);
void audience_leave(struct audience *audience, struct viewer *viewer);

// False where a page says what it may not, or too much.
bool audience_hear(struct audience *audience, struct viewer *viewer, const arthron_Page *message);

// The next batch: an encoded LiveBatch of at most `size` bytes, at least AUDIENCE_BATCH_MAX; 0:
// there is nothing now. *out_next_ns: when to ask again, where the bell does not ring before.
size_t audience_batch(struct audience *audience, struct viewer *viewer, int64_t now_ns,
                      uint8_t *out, size_t size, int64_t *out_next_ns);
