#include "api/routes.h"

#include <string.h>

#define STAFF (INSTRUCTOR | TECHNICIAN)
#define REVIEW (INSTRUCTOR | TRAINEE)
#define SLOW true
#define QUICK false

// clang-format off
const struct route routes[] = {
    {"POST",   "/sign-in",                ANYONE,     post_sign_in, SLOW},
    {"POST",   "/first",                  ANYONE,     post_first, SLOW},
    {"POST",   "/sign-out",               ANYONE,     post_sign_out},
    {"GET",    "/me",                     SIGNED_IN,  get_me},
    {"PATCH",  "/me",                     SIGNED_IN,  patch_me, SLOW},
    {"POST",   "/me/sign-out",            SIGNED_IN,  post_my_sign_out},
    {"GET",    "/tokens",                 SIGNED_IN,  get_tokens},
    {"POST",   "/tokens",                 SIGNED_IN,  post_tokens},
    {"DELETE", "/tokens/*",               SIGNED_IN,  delete_token},
    {"GET",    "/accounts",               STAFF,      get_accounts},
    {"POST",   "/accounts",               STAFF,      post_accounts, SLOW},
    {"PATCH",  "/accounts/*",             STAFF,      patch_account, SLOW},
    {"DELETE", "/accounts/*",             STAFF,      delete_account},
    {"POST",   "/accounts/*/sign-out",    STAFF,      post_account_sign_out},
    {"GET",    "/trainees",               INSTRUCTOR, get_trainees},
    {"POST",   "/trainees",               INSTRUCTOR, post_trainees},
    {"PATCH",  "/trainees/*",             INSTRUCTOR, patch_trainee},
    {"DELETE", "/trainees/*",             INSTRUCTOR, delete_trainee},
    {"POST",   "/trainees/*/erase",       INSTRUCTOR, post_trainee_erase},
    {"POST",   "/trainees/*/sign-out",    INSTRUCTOR, post_trainee_sign_out},
    {"POST",   "/trainees/*/code",        INSTRUCTOR, post_trainee_code},
    {"GET",    "/courses",                INSTRUCTOR, get_courses},
    {"POST",   "/courses",                INSTRUCTOR, post_courses},
    {"GET",    "/courses/*",              INSTRUCTOR, get_course},
    {"GET",    "/courses/*/export",       INSTRUCTOR, get_course_export, SLOW},
    {"PATCH",  "/courses/*",              INSTRUCTOR, patch_course},
    {"DELETE", "/courses/*",              INSTRUCTOR, delete_course},
    {"POST",   "/courses/*/trainees",     INSTRUCTOR, post_course_trainees},
    {"DELETE", "/courses/*/trainees/*",   INSTRUCTOR, delete_course_trainee},
    {"GET",    "/server",                 SIGNED_IN,  get_server},
    {"GET",    "/servers",                STAFF,      get_servers},
    {"GET",    "/stations",               STAFF,      get_stations},
    {"POST",   "/stations/*/code",        STAFF,      post_station_code},
    {"POST",   "/stations/*/revoke",      STAFF,      post_station_revoke},
    {"POST",   "/stations/*/attempt",     REVIEW,     post_station_attempt, QUICK, AT_STATION},
    {"DELETE", "/stations/*/attempt",     REVIEW,     delete_station_attempt, QUICK, AT_STATION},
    {"GET",    "/cases",                  SIGNED_IN,  get_cases},
    {"GET",    "/cases/*",                SIGNED_IN,  get_case},
    {"GET",    "/cases/*/case.json",      SIGNED_IN,  get_case_manifest},
    {"GET",    "/cases/*/anatomy.glb",    SIGNED_IN,  get_case_anatomy},
    {"GET",    "/cases/*/check.json",     SIGNED_IN,  get_case_check},
    {"GET",    "/peer/cases",             SERVER,     get_peer_cases, SLOW},
    {"GET",    "/peer/cases/*",           SERVER,     get_peer_case_file},
    {"POST",   "/peer/revocations",       SERVER,     post_peer_revocations},
    {"GET",    "/sessions",               REVIEW,     get_sessions},
    {"GET",    "/sessions/*",             REVIEW,     get_session},
    {"DELETE", "/sessions/*",             INSTRUCTOR, delete_session, QUICK, AT_TRACE},
    {"GET",    "/sessions/*/trace",       REVIEW,     get_session_trace, QUICK, AT_TRACE},
    {"GET",    "/sessions/*/report",      REVIEW,     get_session_report, SLOW, AT_TRACE},
    {"GET",    "/distributions",          REVIEW,     get_distributions},
    {"GET",    "/audit",                  STAFF,      get_audit},
    {"GET",    "/tasks",                  SIGNED_IN,  get_tasks},
    {"GET",    "/tasks/*",                SIGNED_IN,  get_task},
    {"GET",    "/tasks/*/mark",           INSTRUCTOR, get_mark},
    {"PUT",    "/tasks/*/mark",           INSTRUCTOR, put_mark},
    {"GET",    "/tasks/*/trials",         INSTRUCTOR, get_trials},
    {"GET",    "/tasks/*/contrast",       INSTRUCTOR, get_contrast},
    {"GET",    "/tasks/*/expert",         REVIEW,     get_expert, SLOW},
    {"GET",    "/courses/*/curriculum",   REVIEW,     get_curriculum},
    {"PUT",    "/courses/*/curriculum",   INSTRUCTOR, put_curriculum},
    {"GET",    "/courses/*/progress",     REVIEW,     get_progress},
    {"GET",    "/courses/*/agreement",    INSTRUCTOR, get_agreement},
    {"GET",    "/trainees/me/today",      TRAINEE,    get_today},
    {"GET",    "/attempts",               REVIEW,     get_attempts},
    {"GET",    "/attempts/*/*",           REVIEW,     get_attempt},
    {"GET",    "/attempts/*/*/ratings",   REVIEW,     get_ratings},
    {"POST",   "/attempts/*/*/ratings",   INSTRUCTOR, post_rating},
    {"GET",    "/curve",                  REVIEW,     get_curve},
    {"GET",    "/rate",                   INSTRUCTOR, get_rate},
    {"GET",    "/exams",                  REVIEW,     get_exams},
    {"POST",   "/exams",                  INSTRUCTOR, post_exams},
    {"GET",    "/exams/*",                REVIEW,     get_exam},
    {"DELETE", "/exams/*",                INSTRUCTOR, delete_exam},
    {"POST",   "/exams/*/begin",          INSTRUCTOR, post_exam_begin},
    {"POST",   "/exams/*/interventions",  INSTRUCTOR, post_intervention},
    {"POST",   "/exams/*/release",        INSTRUCTOR, post_exam_release},
    {"GET",    "/metrics",                STAFF,      get_metrics},
    {"GET",    "/healthz",                ALWAYS,     get_healthz},
    {"GET",    "/readyz",                 ALWAYS,     get_readyz},
};
// clang-format on

const int route_count = sizeof routes / sizeof *routes;

// Takes one part of a path. Returns its end, or NULL if the part is empty or too long.
static const char *take_part(const char *at, char out[STORE_NAME_MAX]) {
    size_t length = strcspn(at, "/");
    if (!length || length >= STORE_NAME_MAX)
        return NULL;
    memcpy(out, at, length);
    out[length] = '\0';
    return at + length;
}

static bool matches(const char *pattern, const char *path, char args[2][STORE_NAME_MAX]) {
    int count = 0;
    while (*pattern && path) {
        if (*pattern == '*') {
            path = take_part(path, args[count++]);
            pattern++;
        } else if (*pattern++ != *path++) {
            return false;
        }
    }
    return path && !*path;
}

const struct route *routes_find(const char *method, const char *path,
                                char out_args[2][STORE_NAME_MAX], bool *out_there) {
    size_t prefix = strlen(API_PREFIX);
    *out_there = false;
    if (strncmp(path, API_PREFIX, prefix))
        return NULL;
    for (int i = 0; i < route_count; i++) {
        if (!matches(routes[i].path, path + prefix, out_args))
            continue;
        if (!strcmp(routes[i].method, method))
            return &routes[i];
        *out_there = true;
    }
    return NULL;
}
