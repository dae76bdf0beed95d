// The control connections of stations: binary WebSockets (subprotocol arthron.1) over TLS 1.3 with
// client certificates, served by a thread of this room's own. Version and capabilities are agreed
// here; everything else goes to the handler.
#pragma once

#include "net/mesh_payload.h"
#include "wire/wire.h"

#define CONTROL_PEERS_MAX 64

struct control;

// One connected station, from on_hello to on_gone. Small and copyable: index < CONTROL_PEERS_MAX.
struct control_peer {
    int index;
    uint32_t generation; // tells one user of an index from the next
};

// Calls out of the control thread; none may block.
struct control_handler {
    void *user;
    // A station whose certificate and version are good. Fill *out_welcome's session and case, or
    // return another result with a reason in *out_refusal: the peer is told and closed.
    enum result (*on_hello)(void *user, struct control_peer peer, const arthron_Hello *hello,
                            arthron_Welcome *out_welcome, arthron_Refusal *out_refusal);
    // With each answer to a ping: server = station + offset_ns, within ± uncertainty_ns; rtt_ns is
    // the median of the newest pings.
    void (*on_clock)(void *user, struct control_peer peer, int64_t offset_ns,
                     int64_t uncertainty_ns, int64_t rtt_ns);
    // A frame that came in the control connection; message is the caller's.
    void (*on_frame)(void *user, struct control_peer peer, const arthron_Frame *message,
                     int64_t received_ns);
    // Any other known message of a station: its answer to UdpPath, MeshAsk, mesh_ack.
    void (*on_message)(void *user, struct control_peer peer, const arthron_Control *message);
    void (*on_gone)(void *user, struct control_peer peer);
};

struct control_config {
    const char *address; // to listen on; NULL for all
    int port;            // 0: any free one, control_port tells which
    const char *authority_dir;
    const char *software;
    int64_t hello_timeout_ns; // how long a peer may stay silent before Hello; 5 s
};

// Listens and starts the thread; *out_control is set before any upcall. RESULT_MISSING names a file
// of the authority that is not there, RESULT_IO address and port.
enum result control_create(const struct control_config *config,
                           const struct control_handler *handler, struct control **out_control,
                           struct error *err);

int control_port(const struct control *control);

// Tells every station SHUTDOWN, closes, joins the thread. *control becomes NULL.
void control_destroy(struct control **control);

// From any thread, never waits: queues a message for a peer. False where the peer is gone or its
// queue is full (then a Reply is dropped and counted; what does not come again closes the peer). A
// Resection takes the place of the one of its group that still waits.
// What is sent out of on_hello or soon after goes out behind Welcome.
bool control_send(struct control *control, struct control_peer peer,
                  const arthron_Control *message);

// From any thread, never waits: sends a mesh's payload in chunks, each one only while no message
// waits for that peer. Takes a reference of its own, until the last chunk has gone or the peer has.
// It takes the place of a payload of the same group that is still on its way. False where the peer
// is gone, did not name the capability "meshes", or has WIRE_MESH_GROUPS_MAX others on their way.
bool control_send_mesh(struct control *control, struct control_peer peer,
                       struct mesh_payload *payload);

// From any thread: when the certificate ends that the peer has shown, seconds since 1970; 0 where
// the peer is gone.
int64_t control_certificate_end(struct control *control, struct control_peer peer);

struct control_counts {
    uint64_t unknown_messages;   // of a kind that this version does not know: skipped
    uint64_t malformed_messages; // the peer was told and closed
    uint64_t refused_certificates;
    uint64_t replies_dropped;
};

struct control_counts control_counts(const struct control *control);
