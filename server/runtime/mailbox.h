// The meshes for one page, from a cut worker: the newest payload of each tissue. The cut worker
// never waits for the page. The page waits only for a call of `notify` to return, when it leaves. A
// payload that was not taken when the next one comes is released. Both sides hold references, so
// either may go first.
#pragma once

#include "net/mesh_payload.h"
#include "step/operation.h"

#include <stdbool.h>

struct mailbox;

// notify: called after each put, from the cut worker's thread; it must not wait.
struct mailbox *mailbox_create(void (*notify)(void *user), void *user);
struct mailbox *mailbox_hold(struct mailbox *mailbox);
void mailbox_release(struct mailbox **mailbox); // NULL inside is fine

// The page has gone, or follows something else. After this returns, `notify` is not called any
// more, so its `user` may be released.
void mailbox_leave(struct mailbox *mailbox);
bool mailbox_is_left(const struct mailbox *mailbox);

// The cut worker: takes a reference of its own. session: the session's serial.
void mailbox_put(struct mailbox *mailbox, int tissue, uint64_t session,
                 struct mesh_payload *payload);

// The page's thread: a reference that the caller owns, or NULL.
struct mesh_payload *mailbox_take(struct mailbox *mailbox, int tissue, uint64_t *out_session);
