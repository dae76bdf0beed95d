// A real arthron-server as a child process, in a folder of its own with keys and a case, and the
// stations of a hall: each is enrolled and has a real link.
#pragma once

#include "base/result.h"
#include "folder.h"
#include "load.h"

#include <openssl/evp.h>
#include <stdint.h>
#include <sys/types.h>

struct link;

struct hall {
    pid_t pid;
    pid_t worker; // the thread that answers poses
    char folder[FOLDER_MAX];
    int port, station_count;
    EVP_PKEY *key;          // of all stations
    struct link **links;    // [station_count]
    int caller_count;       // stations that send poses: the first ones
    struct caller *callers; // the sockets and keys of their links
};

struct hall_setup {
    int station_count;
    const char *case_dir;
    const char *field; // of the warp; NULL: that of the server
    int cpu;           // where the server runs, with one worker; -1: anywhere, with its usual ones
    int idle;          // stations beyond these, which never send a pose
    const char *nats;  // addresses of a cluster of it, which the server shares; NULL: it is alone
};

// Every station has a session, and all but the idle ones get replies by datagram when this returns.
// The caller ends it with hall_end, which also removes the folder.
enum result hall_start(const struct hall_setup *setup, struct hall *out_hall, struct error *err);
void hall_end(struct hall *hall);

// Writes a station's keys and certificate without the network.
struct issuer;
enum result hall_enrol(const char *keys, const char *name, EVP_PKEY *key,
                       const struct issuer *authority, struct error *err);

// Processor time so far: of the worker, and of the whole server.
int64_t hall_worker_ns(const struct hall *hall);
int64_t hall_server_ns(const struct hall *hall);

// Memory of the server that is its own, in bytes.
double hall_memory(const struct hall *hall);
