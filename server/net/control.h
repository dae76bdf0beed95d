// The control connections of stations: binary WebSockets (subprotocol arthron.1) over TLS 1.3 with
// client certificates, served by a thread of this room's own. Version and capabilities are agreed
// here; everything else goes to the handler.
#pragma once

#include "net/mesh_payload.h"
#include "wire/wire.h"

struct control;

// One connected station, from on_hello to on_gone. Small and copyable: index <
// control_peers(stations).
struct control_peer {
    int index;
    uint32_t generation; // tells this station from others that used the index before
};

// The control thread calls these; none may block.
struct control_handler {
    void *user;
    // A station with a valid certificate and version. Fill in session, case and token of
    // *out_welcome and return RESULT_OK. With any other result the peer gets *out_refusal as it is
    // (ELSEWHERE with the server that has its session, or another reason, also with retry_ms) and
    // is closed.
    enum result (*on_hello)(void *user, struct control_peer peer, const arthron_Hello *hello,
                            arthron_Welcome *out_welcome, arthron_Refusal *out_refusal);
    // With each answer to a ping: server = station + offset_ns, within ± uncertainty_ns; rtt_ns is
    // the median of the newest pings.
    void (*on_clock)(void *user, struct control_peer peer, int64_t offset_ns,
                     int64_t uncertainty_ns, int64_t rtt_ns);
    // A frame that came over the control connection. The caller owns the message.
    void (*on_frame)(void *user, struct control_peer peer, const arthron_Frame *message,
                     int64_t received_ns);
    // Any other known message of a station: its answer to UdpPath, MeshAsk, mesh_ack,
    // Marker.
    void (*on_message)(void *user, struct control_peer peer, const arthron_Control *message);
    void (*on_gone)(void *user, struct control_peer peer);
    // The station asks for meshes too often, or sends too many messages: it has to wait. NULL: it
    // is not told.
    void (*on_slowed)(void *user, struct control_peer peer, bool asks);
    // When the station's newest frame came by datagram; its connection may be silent meanwhile.
    // NULL: there are no datagrams.
    int64_t (*datagram_ns)(void *user, struct control_peer peer);
};

struct control_config {
    const char *address; // to listen on; NULL for all
    int port;            // 0: any free one, control_port tells which
    int stations;        // that may be connected, each with a visit
    const char *authority_dir;
    const char *software;
    int64_t hello_timeout_ns; // how long a peer may stay silent before Hello; 5 s
};

// The handles of so many stations: each may have a visit beside its connection.
static inline int control_peers(int stations) {
    return 2 * stations;
}

// Listens and starts the thread; *out_control is set before the handler is called. RESULT_MISSING
// names a missing file of the authority, RESULT_IO address and port.
enum result control_create(const struct control_config *config,
                           const struct control_handler *handler, struct control **out_control,
                           struct error *err);

int control_port(const struct control *control);

// Tells every station SHUTDOWN, closes, joins the thread. *control becomes NULL.
void control_destroy(struct control **control);

// From any thread, never waits: queues a message for a peer. False if the peer is gone or its queue
// is full. If the queue is full, a Reply is dropped and counted; for a message that will not come
// again, the peer is closed. A Resection replaces the one of its group that still waits. Messages
// that on_hello sends, or others at the same time, go out after Welcome.
bool control_send(struct control *control, struct control_peer peer,
                  const arthron_Control *message);

// From any thread, never waits: sends Moved with that server ("host:port") and closes. What waits
// for the peer is dropped, and on_gone is called before it is closed. False if the peer is gone.
bool control_move(struct control *control, struct control_peer peer, const char *server);

// From any thread, never waits: sends a mesh's payload in chunks, each one only while no message
// waits for that peer. Holds a reference of its own until the last chunk is sent or the peer is
// gone. It replaces a payload of the same group that is still on its way. False if the peer is
// gone, did not name the capability "meshes", or has WIRE_MESH_GROUPS_MAX others on their way.
bool control_send_mesh(struct control *control, struct control_peer peer,
                       struct mesh_payload *payload);

// From any thread: the end of the peer's certificate, in seconds since 1970; 0: the peer is gone.
int64_t control_certificate_end(struct control *control, struct control_peer peer);

struct control_counts {
    uint64_t unknown_messages;   // of a kind that this version does not know: skipped
    uint64_t malformed_messages; // after each the peer was refused and closed
    uint64_t refused_certificates;
    uint64_t replies_dropped;
    uint64_t shut; // connections turned away or shut because too many proved no certificate
};

// When the control thread was last free for a round, of which there are ten a second; monotonic.
// Any thread.
int64_t control_round_ns(const struct control *control);

struct control_counts control_counts(const struct control *control);
