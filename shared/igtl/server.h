// Serves poses, meshes and events to programs that speak OpenIGTLink (3D Slicer, PLUS, pyigtl): a
// TCP port that anybody who reaches it may read. Nothing is encrypted. A thread of its own serves
// the clients.
//
// Nobody has to ask: a client gets TRANSFORM, POLYDATA, STRING and STATUS as they are put. After
// STT_TDATA or STT_QTDATA it gets TDATA or QTDATA instead of TRANSFORM, with at least `resolution`
// milliseconds between two, until STP_. GET_TRANS, GET_TDATA, GET_QTDATA, GET_POLYDATA, GET_STATUS
// and GET_CAPABIL are answered at once; a device's name in the request chooses one pose or mesh.
//
// Messages have the highest header version that the client has sent, 3 at most, and 1 until it
// sends one. From version 2 on a TRANSFORM has the metadata "TransformStatus", as PLUS does: "OK",
// or "MISSING" for a pose that is held. TDATA and QTDATA have it for each tool, as "NAMEStatus".
// What is asked for and not there is answered by RTS_POLYDATA or a STATUS of code 4 (not found).
//
// A slow client holds nothing up. While its connection takes what it is sent, it gets every set of
// poses; else it skips to the newest. Of a mesh it gets the newest. A client that lets
// IGTL_STRINGS_MAX strings wait, or takes nothing for IGTL_SILENCE_S, is dropped with a log line.
#pragma once

#include "base/pose.h"
#include "base/result.h"
#include "base/sample.h"
#include "igtl/content.h"

#include <stdbool.h>
#include <stdint.h>

#define IGTL_PORT 18944      // that OpenIGTLink programs expect
#define IGTL_CLIENTS_MAX 16  // at a time; others are closed
#define IGTL_POSES_MAX 32    // of a set
#define IGTL_MESHES_MAX 16   // names
#define IGTL_STRINGS_MAX 256 // that wait for a client
#define IGTL_SILENCE_S 30
#define IGTL_VERTICES_MAX (1 << 20) // of a mesh; so many triangles, too

struct igtl_server;

struct igtl_server_config {
    char address[64]; // IPv4 or IPv6, that it listens on; empty: 127.0.0.1
    int port;         // 0: any free one
    double rate_hz;   // of sets for a client that did not ask otherwise, at most; 0: every set
    char device[IGTL_DEVICE_SIZE]; // that sends TDATA, QTDATA, STATUS and CAPABILITY
};

// Listens, and starts the thread. RESULT_INVALID: the address is none. RESULT_IO says why it cannot
// listen. *out_server is NULL where it fails.
enum result igtl_server_create(const struct igtl_server_config *config,
                               struct igtl_server **out_server, struct error *err);

// Gives clients half a second for what waits. NULL inside is fine; *server becomes NULL.
void igtl_server_destroy(struct igtl_server **server);

int igtl_server_port(const struct igtl_server *server);
int igtl_server_clients(const struct igtl_server *server); // now; any thread

// ---- poses, strings, status: from one thread, which never waits; nothing is allocated ----------

// Times are UTC, in nanoseconds since 1970.
struct igtl_pose {
    char name[IGTL_DEVICE_SIZE]; // printable ASCII, one of its kind in a set
    enum validity validity;      // LOST: it is not sent
    int64_t utc_ns;              // when it was measured: the TRANSFORM's stamp
    pose T_world_body;           // mm; the world is the same for all that this server sends
};

// All poses of one moment.
struct igtl_poses {
    int64_t utc_ns; // the stamp of TDATA and QTDATA
    int count;
    struct igtl_pose poses[IGTL_POSES_MAX];
};

// Copies the set. False where the server's thread is so far behind (256 sets) that it was lost.
bool igtl_server_put_poses(struct igtl_server *server, const struct igtl_poses *poses);

// A STRING, to each client that is there now. The text is UTF-8; what is longer than IGTL_TEXT_SIZE
// is cut. False as above.
bool igtl_server_put_string(struct igtl_server *server, const char *device, const char *text,
                            int64_t utc_ns);

// The STATUS that clients get now, when they come, and when they ask.
struct igtl_state {
    int code;                    // OpenIGTLink's: 1 OK, 13 not ready, ... (igtlStatusMessage.h)
    int64_t subcode;             // the sender's own
    char name[IGTL_DEVICE_SIZE]; // of the error; empty where there is none
    char text[IGTL_TEXT_SIZE];   // for a person
    int64_t utc_ns;
};

// Sends it where it differs from the one before in more than the time. False as above.
bool igtl_server_put_status(struct igtl_server *server, const struct igtl_state *state);

// ---- meshes: from any thread; waits for a moment, and allocates -----------------------------

// Triangles, counter-clockwise seen from outside; the caller's arrays.
struct igtl_mesh {
    char name[IGTL_DEVICE_SIZE];
    int64_t utc_ns; // when it became so
    int vertex_count, triangle_count;
    const float *positions;    // 3 * vertex_count, mm, in the mesh's own frame
    const uint32_t *triangles; // 3 * triangle_count, below vertex_count
};

// Takes the place of the mesh of that name: clients get it now, when they come, and when they ask.
// Without vertices and triangles it empties it, and its name may be forgotten for another one's.
// Copies the arrays. A count out of its bounds is a CHECK, and so are more than IGTL_MESHES_MAX
// meshes that are not empty.
void igtl_server_put_mesh(struct igtl_server *server, const struct igtl_mesh *mesh);
