// What the station shows, for programs that speak OpenIGTLink (docs/OPENIGTLINK.md): poses as
// measured and as shown, events, the attempt that runs, the session's state, the meshes that are
// cut.
#pragma once

#include "base/marker.h"
#include "igtl/server.h"
#include "view/view.h"
#include "wire/tissue.h"
#include "wire/wire.h"

struct openigtlink;

// Logs where it listens, with a warning where others than this PC may reach it. RESULT_INVALID: the
// address is none; RESULT_IO says why it cannot listen.
enum result openigtlink_create(const struct igtl_server_config *config,
                               struct openigtlink **out_outlet, struct error *err);
void openigtlink_destroy(struct openigtlink **outlet); // NULL inside is fine; becomes NULL

int openigtlink_port(const struct openigtlink *outlet);

// What openigtlink_create would find at its port: nobody, a station that runs, or what *err says.
// Waits for at most a second or two.
enum view_port_use openigtlink_look_at_port(const struct igtl_server_config *config,
                                            struct error *err);

// ---- one thread, which never waits
// ---------------------------------------------------------------

// Once for each frame. True where somebody watches; else there is nothing to show.
bool openigtlink_follow(struct openigtlink *outlet, arthron_SessionState state);

// What is newest, from predict_view. Events that came while nobody watched are not told later.
void openigtlink_show(struct openigtlink *outlet, const arthron_View *view);

void openigtlink_mark(struct openigtlink *outlet, const struct marker *marker);

// ---- any one thread
// ------------------------------------------------------------------------------

// As link_config.meshes_changed: number 0 empties it.
void openigtlink_mesh(void *outlet, const char *group, const struct tissue *tissue);
