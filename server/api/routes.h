// The one table of the requests of /api/v1, with the roles that may send them.
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

void post_sign_in(struct api_call *call);
void post_first(struct api_call *call);
void post_sign_out(struct api_call *call);
void get_me(struct api_call *call);
void post_my_sign_out(struct api_call *call);
void patch_me(struct api_call *call);

void get_tokens(struct api_call *call);
void post_tokens(struct api_call *call);
void delete_token(struct api_call *call);
void get_accounts(struct api_call *call);
void post_accounts(struct api_call *call);
void patch_account(struct api_call *call);
void delete_account(struct api_call *call);
void post_account_sign_out(struct api_call *call);

void get_trainees(struct api_call *call);
void post_trainees(struct api_call *call);
void patch_trainee(struct api_call *call);
void delete_trainee(struct api_call *call);
void post_trainee_erase(struct api_call *call);
void post_trainee_sign_out(struct api_call *call);
void post_trainee_code(struct api_call *call);
void get_courses(struct api_call *call);
void post_courses(struct api_call *call);
void get_course(struct api_call *call);
void get_course_export(struct api_call *call); // study.c
void patch_course(struct api_call *call);
void delete_course(struct api_call *call);
void post_course_trainees(struct api_call *call);
void delete_course_trainee(struct api_call *call);

void get_server(struct api_call *call);
void get_servers(struct api_call *call); // servers.c
void get_metrics(struct api_call *call); // watch.c
void get_healthz(struct api_call *call);
void get_readyz(struct api_call *call);
void get_stations(struct api_call *call);
void post_peer_revocations(struct api_call *call); // revoke.c
void post_station_code(struct api_call *call);
void post_station_revoke(struct api_call *call);
void post_station_attempt(struct api_call *call);
void delete_station_attempt(struct api_call *call);
void get_cases(struct api_call *call);
void get_case(struct api_call *call);
void get_case_manifest(struct api_call *call);
void get_case_anatomy(struct api_call *call);
void get_case_check(struct api_call *call);

void get_peer_cases(struct api_call *call); // peer_cases.c
void get_peer_case_file(struct api_call *call);

void get_sessions(struct api_call *call);
void get_session(struct api_call *call);
void delete_session(struct api_call *call);
void get_session_trace(struct api_call *call);
void get_session_report(struct api_call *call);
void get_distributions(struct api_call *call);
void get_audit(struct api_call *call);

void get_tasks(struct api_call *call);
void get_task(struct api_call *call);
void get_mark(struct api_call *call);
void put_mark(struct api_call *call);
void get_trials(struct api_call *call);
void get_contrast(struct api_call *call);
void get_expert(struct api_call *call); // expert.c
void get_curriculum(struct api_call *call);
void put_curriculum(struct api_call *call);
void get_progress(struct api_call *call);
void get_today(struct api_call *call);
void get_attempts(struct api_call *call);
void get_attempt(struct api_call *call);
void get_curve(struct api_call *call);
void get_ratings(struct api_call *call);
void post_rating(struct api_call *call);
void get_rate(struct api_call *call);
void get_agreement(struct api_call *call);
void get_exams(struct api_call *call);
void post_exams(struct api_call *call);
void get_exam(struct api_call *call);
void delete_exam(struct api_call *call);
void post_exam_begin(struct api_call *call);
void post_intervention(struct api_call *call);
void post_exam_release(struct api_call *call);
