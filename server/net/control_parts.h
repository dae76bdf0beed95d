// The members of struct control, for control.c (threads, sockets), control_queue.c (slots, queues),
// control_mesh.c (meshes) and peer.c (the protocol). They belong to the control thread unless a
// comment says otherwise.
#pragma once

#include "base/bucket.h"
#include "base/clock.h"
#include "net/control.h"
#include "net/door.h"
#include "net/identity.h"
#include "net/outbox.h"
#include "net/registrar.h"
#include "websocket/ws_server.h"

#include <libwebsockets.h>
#include <pthread.h>
#include <stdatomic.h>

struct outgoing_chunk {
    uint8_t header[LWS_PRE];
    uint8_t bytes[WIRE_CHUNK_MAX];
};

// One connection, in libwebsockets' memory for it.
struct peer {
    struct control *control;
    struct lws *wsi;
    struct identity identity;
    bool meshes;  // named that capability
    bool markers; // too
    bool enrols;  // speaks the subprotocol of enrolment
    bool applies; // and waits for the registrar's answer
    bool visit;   // its Hello only asks
    bool proved;  // has shown a certificate that is good, and not too often
    bool agreed;  // Hello was good: it has a slot
    bool closing; // sends its last message, and receives nothing any more
    bool done;    // has sent it
    bool left;    // and its close frame
    bool slows;   // sends too fast: from the next turn on
    bool slowed;  // nothing of it is read
    struct control_peer handle;
    struct clock_offset clock;
    int pings;
    int64_t ping_ns, pong_ns; // the last ones
    int64_t unanswered_ns;    // the first Ping without a Pong; 0: there is none
    int64_t their_ping_ns;    // the last Ping of the station
    bool says_rest;           // it said so
    int64_t frame_ns;         // the last Frame that came here
    int64_t warned_s;         // that its certificate ends; 0: not yet
    int64_t tick_ns;          // when the next tick is due, once agreed
    int64_t slow_said_ns;
    struct bucket messages, asks;
    bool asks_late; // late_ask waits for its turn
    arthron_MeshAsk late_ask;
    size_t used; // of incoming
    uint8_t incoming[WIRE_CONTROL_MAX];
    struct outgoing urgent; // goes before the outbox: Welcome, Refusal, Enrolled; size 0: none
};

// A payload on its way to a peer.
struct delivery {
    struct mesh_payload *payload; // NULL: none
    uint32_t next;                // chunk
};

// One agreed peer, for other threads; all of it under the lock.
struct peer_slot {
    uint32_t generation;
    struct peer *peer; // NULL: free
    struct outbox *outbox;
    bool meshes;     // it takes meshes
    int64_t until_s; // end of its certificate
    struct delivery deliveries[WIRE_MESH_GROUPS_MAX];
    int turn;       // of deliveries
    bool wakes;     // the control thread has something to do for it: it is in `woken`
    bool overflown; // a message that it must not miss had no room
    char server[sizeof((arthron_Moved){0}.server)]; // where to send it; empty: it stays
};

struct control {
    struct control_handler handler;
    struct registrar *registrar;
    struct door *door;
    int64_t shut_said_ns; // when the log last told of connections that were shut
    char *software;
    int64_t hello_timeout_ns;
    struct ws_server *server;
    lws_sorted_usec_list_t round; // of ticks
    SSL_CTX *tls;                 // of the connections to come; libwebsockets'
    int connections;
    arthron_Control message; // the one being read
    arthron_MeshChunk chunk; // the one being written
    struct outgoing_chunk chunk_bytes;
    pthread_mutex_t lock; // held for a copy of one message at most
    int slot_count;
    struct peer_slot *slots;
    int *woken, woken_count;     // slots, under the lock
    int *serving, serving_count; // the same of one turn
    atomic_uint_fast64_t unknown_messages, malformed_messages, refused_certificates,
        replies_dropped, shut;
    atomic_int_fast64_t round_ns; // the last one
};

// ---- control.c ----------------------------------------------------------------------------------

void control_tell_slowed(struct peer *peer, bool asks);

// ---- control_queue.c ----------------------------------------------------------------------------

// Gives the peer a slot, a handle and an outbox. False: all are taken.
bool control_take_slot(struct peer *peer);
void control_free_slot(struct peer *peer);

// Sends `message` before all queued ones; with `last` the connection closes after it.
void control_send_urgent(struct peer *peer, const arthron_Control *message, bool last);

// A Ping or Pong to an agreed peer, by the control thread, which need not be woken.
void control_send_from_here(struct peer *peer, const arthron_Control *message);

// There is something to do for the slot. True: the control thread has to be woken. Under the lock.
bool control_wake_slot(struct control *control, struct peer_slot *slot);

// The slot of a handle; NULL: the peer is gone. Under the lock.
struct peer_slot *control_find_slot(struct control *control, struct control_peer handle);

// Whether more is to be written. Each ask whether a connection is writable takes a turn of the
// thread.
bool control_has_more(struct peer *peer);

// What is written next, but for meshes. False: there is nothing.
bool control_next_message(struct peer *peer, struct outgoing *out);

// Ends the connection of a peer that takes nothing.
void control_end_soon(struct peer *peer);

// ---- control_mesh.c: meshes ---------------------------------------------------------------------

// Encodes the next chunk of the peer's payloads into control->chunk_bytes. Returns its size; 0: no
// chunk is left.
size_t control_next_chunk(struct peer *peer);
void control_drop_meshes(struct peer_slot *slot); // of a slot that is already free

// ---- peer.c: the protocol -----------------------------------------------------------------------

void peer_opened(struct peer *peer);
void peer_receive(struct peer *peer, int64_t now_ns); // a whole message is in peer->incoming
void peer_answered(struct peer *peer, const arthron_Control *answer); // by the registrar
void peer_gone(struct peer *peer);

// Every agreed peer whose certificate is revoked.
void peer_refuse_revoked(struct control *control);

// Timeouts, pings, revocation. False: close it at once. *out_next_us: when to call again.
bool peer_tick(struct peer *peer, int64_t now_ns, int64_t *out_next_us);

// Tells the peer why, and closes. It has lost its slot when this returns.
void peer_refuse(struct peer *peer, arthron_Refusal_Reason reason, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

// Tells an agreed peer which server to go to, and closes. It has lost its slot when this returns.
void peer_move(struct peer *peer, const char *server);

// As peer_refuse, for a message that contradicts the schema; counted.
void peer_malformed(struct peer *peer, const char *text);
