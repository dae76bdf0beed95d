// The table of the requests of /api/v1, with the roles that may send them. Its rows are made by
// describe.py of openapi.yaml.
#pragma once

#include "api/call.h"

#define API_PREFIX "/api/v1"

// Roles as bits. NOBODY: also without a sign-in.
enum {
    TECHNICIAN = 1 << ROLE_TECHNICIAN,
    INSTRUCTOR = 1 << ROLE_INSTRUCTOR,
    TRAINEE = 1 << ROLE_TRAINEE, // the answer must contain only the trainee's own data
    NOBODY = 1 << ROLE_COUNT,
    SERVER = 1 << (ROLE_COUNT + 1), // another one, by this one's secret
    ALWAYS = 1 << (ROLE_COUNT + 2), // anybody, also while the records cannot be read
    SIGNED_IN = TECHNICIAN | INSTRUCTOR | TRAINEE,
    ANYONE = SIGNED_IN | NOBODY
};

// Which of several servers answers.
enum route_place {
    HERE,       // the one that is asked
    AT_STATION, // the one that serves the station of the path
    AT_TRACE    // the one that has the trace of the session of the path
};

struct route {
    const char *method;
    const char *path; // behind API_PREFIX; * is one part of any name
    int roles;
    void (*answer)(struct api_call *call); // with the store open, except of ALWAYS
    bool slow;                             // it encodes a password, makes a report, or rehearses
    enum route_place place;
};

extern const struct route routes[];
extern const int route_count;

// The route of a request; out_args gets the parts of its path. NULL: there is none. *out_there: the
// path exists for other methods.
const struct route *routes_find(const char *method, const char *path,
                                char out_args[2][STORE_NAME_MAX], bool *out_there);

// ---- answers: each in the file of its kind ----

#define ROUTE(method, path, roles, answer, slow, place) void answer(struct api_call *call);
#include "routes.inc"
#undef ROUTE
