// What the tests of the network share: a temporary folder with an authority, enrolled stations, and
// a control room whose handler, in place of the sessions, writes down what it is told and answers
// each frame.
#pragma once

#include "folder.h"
#include "net/control.h"

#include <pthread.h>
#include <stdatomic.h>

#define TEST_SERVER_STATIONS 8

struct test_server {
    char dir[FOLDER_MAX];       // temporary; dir/keys is the authority's
    char keys[FOLDER_MAX + 16]; // folder of the authority
    struct control *control;
    int port; // the same after test_server_restart
    int64_t hello_timeout_ns;
    const char *only_host;          // in the server\'s certificate; NULL: localhost and 127.0.0.1
    const arthron_Refusal *refusal; // answers Hello with it, NULL: with Welcome
    uint64_t token;                 // in Welcome
    uint8_t session_id[16];         // too
    arthron_UdpKeys *keys_at_hello; // sent behind Welcome, NULL: none
    uint64_t case_hash;
    const struct knee_frame *knee; // of the session, NULL: it is not told
    // Told of MeshAsk and mesh_ack in the control thread, where not NULL.
    void (*on_mesh)(struct test_server *test_server, struct control_peer peer,
                    const arthron_Control *message);
    pthread_mutex_t lock; // guards what follows
    arthron_Hello hello;  // the last one
    struct control_peer peer;
    int64_t offset_ns, uncertainty_ns, rtt_ns;
    uint64_t challenge; // last UdpPath answered
    atomic_int hellos, refused, clocks, frames, messages, gone;
};

void test_server_open(struct test_server *test_server); // folder, authority, control room
void test_server_close(struct test_server *test_server);
void test_server_stop(struct test_server *test_server); // the control room only
void test_server_start(struct test_server *test_server);

// Enrols a station; its keys are in *out_keys_dir (dir/NAME).
void test_server_enrol(struct test_server *test_server, const char *station,
                       char out_keys_dir[128]);

// True as soon as *counter is at least `wanted`; false after 10 s.
bool wait_for(atomic_int *counter, int wanted);
