// A recorded session that is served, and what its record says that clients are to get: read without
// the room that serves.
#pragma once

#include "replay/bites.h"

extern char served_path[FOLDER_MAX + 32]; // the session of bites.h, with a date, remarks, a marker

int make_served(void **state);
int remove_served(void **state);

enum { SETS_MAX = 8192, POSES_MAX = 32, TEXTS_MAX = 512, MESHES_MAX = 32 };

struct expected_pose {
    char name[32];
    int64_t stamp_ns;
    pose T;
};

// What the record says that is to come.
extern struct expected {
    int set_count, text_count, state_count, mesh_count;
    struct expected_set {
        int64_t stamp_ns;
        int count;
        struct expected_pose poses[POSES_MAX];
    } sets[SETS_MAX];
    const char *text_devices[TEXTS_MAX];
    int64_t text_stamps_ns[TEXTS_MAX];
    char texts[TEXTS_MAX][64], states[TEXTS_MAX][16];
    int64_t mesh_stamps_ns[MESHES_MAX];
    struct mesh
        meshes[MESHES_MAX]; // of the medial meniscus: before the first step, and as it lands
} expected;

void expect_all(void);
