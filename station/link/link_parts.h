// The inside of a link: what link.c (the caller's thread) and control.c (the control connection and
// its thread) share.
#pragma once

#include "base/clock.h"
#include "base/ring.h"
#include "link/link.h"
#include "link/meshes.h"
#include "link/path.h"
#include "link/pings.h"
#include "link/renewal.h"
#include "link/servers.h"
#include "link/trust.h"
#include "link/udp.h"

#include <libwebsockets.h>
#include <pthread.h>
#include <stdatomic.h>

#define FRAMES_REMEMBERED 2048 // a power of two

struct control_message {
    uint32_t size;
    uint8_t header[LWS_PRE]; // libwebsockets writes its own before the bytes
    uint8_t bytes[WIRE_CONTROL_MAX];
};

// What the control connection hands to the caller's thread.
struct arrival {
    uint64_t connect; // link->connects when it came
    bool is_keys;
    union {
        arthron_Reply reply;
        struct {
            arthron_UdpKeys keys;
            struct sockaddr_storage server;
        };
    };
};

// One control connection; all of it belongs to the control thread.
struct control_connection {
    struct lws_context *context;
    struct lws *socket; // NULL: not connected
    lws_sorted_usec_list_t retry, patience;
    uint16_t attempts;
    struct servers servers;
    bool connecting; // or connected: how it ends decides what is tried next
    bool decided;    // a message said it before: next_ms
    bool was_silent;
    int next_ms;        // as of servers_lost
    struct ring *queue; // of struct control_message: Hello, pings and answers
    struct clock_offset clock;
    bool welcomed;
    bool meshes;       // both sides can
    bool path;         // too: challenges come in replies
    bool markers;      // too
    bool session_open; // the server said that it takes frames
    struct pings pings;
    size_t used; // of incoming
    uint8_t incoming[WIRE_CHUNK_MAX];
    arthron_Control message;
    arthron_MeshChunk chunk;
    char trouble[SERVERS_MAX + 1][256]; // last logged, by servers.present
};

// The caller's thread only.
struct sender {
    uint64_t connect; // the connection that all of this belongs to
    struct path path;
    struct udp udp;
    uint64_t challenge;                  // the last that was sent back
    uint64_t waiting[FRAMES_REMEMBERED]; // [number % size]: sent and not answered yet
    bool told_left_out;                  // of samples that this server does not take
};

struct link {
    struct link_config config; // its texts are ours
    uint64_t id;               // of this link: the same in every Hello
    struct trust trust;
    struct renewal *renewal;  // NULL: of a visit
    atomic_bool keys_changed; // the control thread has to take them
    pthread_t thread;
    atomic_bool stopping;
    struct control_connection control;
    struct sender sender;
    struct meshes *meshes;
    struct marker_queue markers;     // caller to control thread
    struct ring *frames;             // caller to control thread: struct control_message
    struct ring *arrivals;           // control thread to caller: struct arrival
    int arrival_fd;                  // eventfd, signalled behind each arrival
    atomic_bool ready;               // the clock is known and the session is open: frames may go
    atomic_bool described;           // the server takes the channels of described instruments
    atomic_bool forces;              // the server takes forces, and so many samples
    atomic_int path;                 // enum link_path while ready
    atomic_int_fast64_t datagram_ns; // when the last reply came by datagram
    atomic_uint_fast64_t connects, frames_sent, replies, unknown_messages;
    pthread_mutex_t lock;
    struct link_status status;   // under the lock: all that is not atomic above
    struct link_session session; // too
    atomic_uint_fast64_t session_changes;
    arthron_AttemptState attempt; // too
    atomic_uint_fast64_t attempt_changes;
};

// Encodes a message into a queue of struct control_message. False: it is full.
bool control_push(struct ring *queue, const arthron_Control *message);

// How a station introduces itself, and what it and the server can both.
void link_introduce(const struct link *link, arthron_Hello *out_hello);
void link_agree(struct link *link, const arthron_Welcome *welcome);

void link_keep_attempt(struct link *link, const arthron_AttemptState *attempt);

// The next marker to send, if the server takes any. False: there is none.
bool link_next_marker(struct link *link, arthron_Control *out_message);

// Makes the context. The thread then calls control_serve, which returns once link->stopping is set
// and lws_cancel_service was called.
enum result control_init(struct link *link, struct error *err);
void control_serve(struct link *link);
void control_fini(struct link *link);
