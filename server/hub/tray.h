// Where a theatre leaves the meshes for one page that looks on: the newest payload of each tissue.
// Neither side waits for the other; a payload that was not taken when the next one comes is
// released. Held by both, so that either may be gone first.
#pragma once

#include "net/mesh_payload.h"
#include "step/operation.h"

#include <stdbool.h>

struct tray;

// ring: called where something was put in, out of the theatre's thread; must not wait.
struct tray *tray_create(void (*ring)(void *user), void *user);
struct tray *tray_hold(struct tray *tray);
void tray_release(struct tray **tray); // NULL inside is fine

// The page has gone, or looks elsewhere.
void tray_leave(struct tray *tray);
bool tray_is_left(const struct tray *tray);

// The theatre's: takes a reference of its own. session: struct live's serial.
void tray_put(struct tray *tray, int tissue, uint64_t session, struct mesh_payload *payload);

// The page's: a reference that is the caller's, or NULL.
struct mesh_payload *tray_take(struct tray *tray, int tissue, uint64_t *out_session);
