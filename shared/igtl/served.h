// What a server has for its clients: the latest sets of poses and strings, the status, the meshes.
// One thread.
#pragma once

#include "igtl/server.h"

#include <stddef.h>

// That a client may be behind: twice what may come at once, so that one that reads loses nothing.
#define SERVED_SETS 512

// A whole message that several clients may be in the middle of.
struct served_bytes {
    int users;
    size_t size;
    uint8_t bytes[];
};

struct served_set {
    int64_t put_ns; // monotonic
    struct igtl_poses poses;
};

struct served_string {
    char device[IGTL_DEVICE_SIZE];
    char text[IGTL_TEXT_SIZE + 1]; // one byte more, which tells that it has to be cut
    int64_t utc_ns;
};

struct served_mesh {
    char name[IGTL_DEVICE_SIZE]; // empty: no mesh
    uint64_t count;              // how often it was put
    int64_t utc_ns;
    struct served_bytes *content;
    struct served_bytes *messages[IGTL_NEWEST_VERSION]; // by version - 1; NULL: not needed yet
};

// Each is numbered from 1; the newest has the number that is the count.
struct served {
    char device[IGTL_DEVICE_SIZE];
    int64_t interval_ns; // of sets, for a client that did not ask
    uint64_t set_count, string_count, state_count;
    struct served_set sets[SERVED_SETS];
    struct served_string strings[IGTL_STRINGS_MAX];
    struct igtl_state state;
    struct served_mesh meshes[IGTL_MESHES_MAX];
};

// The caller zeroes it, and sets device and interval.
void served_fini(struct served *served);

void served_put_poses(struct served *served, const struct igtl_poses *poses, int64_t now_ns);
void served_put_string(struct served *served, const struct served_string *string);
void served_put_state(struct served *served, const struct igtl_state *state);
void served_put_mesh(struct served *served, int place, const char *name, int64_t utc_ns,
                     struct served_bytes *content); // takes the content over

const struct served_set *served_get_set(const struct served *served, uint64_t number);
const struct served_string *served_get_string(const struct served *served, uint64_t number);

// The mesh as a POLYDATA; the caller releases it.
struct served_bytes *served_use_mesh(struct served_mesh *mesh, int version);

struct served_bytes *served_bytes_create(size_t size);  // with one user
void served_bytes_release(struct served_bytes **bytes); // NULL inside is fine
