// Who may ask what: the one table of all that /api/v1 answers.
#pragma once

#include "api/call.h"

#define API_PREFIX "/api/v1"

// Roles as bits. NOBODY: without having signed in, too.
enum {
    TECHNICIAN = 1 << ROLE_TECHNICIAN,
    INSTRUCTOR = 1 << ROLE_INSTRUCTOR,
    TRAINEE = 1 << ROLE_TRAINEE, // only about what is their own: the answer's matter
    NOBODY = 1 << ROLE_COUNT,
    SIGNED_IN = TECHNICIAN | INSTRUCTOR | TRAINEE,
    ANYONE = SIGNED_IN | NOBODY
};

struct route {
    const char *method;
    const char *path; // behind API_PREFIX; * is one part of any name
    int roles;
    void (*answer)(struct call *call); // with the store open
};

extern const struct route routes[];
extern const int route_count;

// The route of a request, its parts into `args`. NULL: there is none; *out_there: of this path, but
// of other methods.
const struct route *routes_find(const char *method, const char *path,
                                char out_args[2][STORE_NAME_MAX], bool *out_there);

// ---- what they answer: sign_in.c, accounts.c, people.c, stations.c, cases.c, sessions.c
// ----------------------

void post_sign_in(struct call *call);
void post_first(struct call *call);
void post_sign_out(struct call *call);
void get_me(struct call *call);
void post_my_sign_out(struct call *call);
void patch_me(struct call *call);

void get_tokens(struct call *call);
void post_tokens(struct call *call);
void delete_token(struct call *call);
void get_accounts(struct call *call);
void post_accounts(struct call *call);
void patch_account(struct call *call);
void delete_account(struct call *call);
void post_account_sign_out(struct call *call);

void get_trainees(struct call *call);
void post_trainees(struct call *call);
void patch_trainee(struct call *call);
void delete_trainee(struct call *call);
void post_trainee_erase(struct call *call);
void post_trainee_sign_out(struct call *call);
void post_trainee_code(struct call *call);
void get_courses(struct call *call);
void post_courses(struct call *call);
void get_course(struct call *call);
void patch_course(struct call *call);
void delete_course(struct call *call);
void post_course_trainees(struct call *call);
void delete_course_trainee(struct call *call);

void get_server(struct call *call);
void get_stations(struct call *call);
void post_station_code(struct call *call);
void post_station_revoke(struct call *call);
void get_cases(struct call *call);
void get_case(struct call *call);
void get_case_manifest(struct call *call);
void get_case_anatomy(struct call *call);
void get_case_check(struct call *call);

void get_sessions(struct call *call);
void get_session(struct call *call);
void delete_session(struct call *call);
void get_session_trace(struct call *call);
void get_session_report(struct call *call);
void get_distributions(struct call *call);
void get_audit(struct call *call);
