// Answers the requests of /api/v1 (docs/API.md): sign-in and roles, people, records, cases,
// stations, tasks, courses and exams. It has no sockets and sees no running session, but passes
// commands on.
#pragma once

#include "base/result.h"
#include "case/case.h"
#include "cluster/ownership.h"
#include "signon/settings.h"
#include "task/task.h"
#include "web/web.h"
#include "wire/wire.h"

#include <stdio.h>

struct store;

#define API_WHY_MAX 80

// knee: as the server has loaded it; NULL: the case is read here. refusal: why the server could not
// load it, so that `knee` is another; empty or NULL: it could.
struct api_case {
    const char *name, *dir;
    const struct knee_case *knee;
    const char *refusal;
};

struct api_station {
    const char *name, *case_name, *trainee; // trainee: empty if the config names none
    bool start_by_command;
};

// records: the source of other sessions' figures; NULL: without them. course: only its trainees'
// sessions; NULL: all. hide_few: as in store_figures_on.
struct api_report {
    const char *trace, *records, *course;
    bool hide_few;
};

// Of several servers. From any thread.
struct api_cluster {
    void *user;
    // This server, and the others that are known, as cluster_peers.
    void (*self)(void *user, struct cluster_peer *out_peer);
    int (*peers)(void *user, struct cluster_peer *out_peers, int room);
    // The name of another server that serves the station with this index and lives; else empty.
    void (*server_of)(void *user, int station, char out_name[SERVER_NAME_SIZE]);
    const char *folder; // for files of other servers while they are passed on
};

// Everything in it must outlive the api.
struct api_config {
    const char *records;  // the database (store); made if it does not exist
    const char *keys_dir; // of the authority (net/authority.h)
    const char *link;     // where its pages are, "https://server.example.org:4880/"; for the log
    const struct api_case *cases;
    int case_count;
    const struct api_station *stations;
    int station_count;
    // Writes a session's page, whole or not at all; from one thread at a time.
    enum result (*report)(void *user, const struct api_report *about, FILE *file,
                          struct error *err);
    int port;                 // the server's, for stations
    void *user;               // of `report`, `command` and `rehearse`
    case_checker check_case;  // before a case is read here; or NULL
    const struct task *tasks; // the library, as read at the server's start
    int task_count;
    // A command to a running session; it waits. From any thread.
    void (*command)(void *user, const char *actor, const arthron_Command *command,
                    arthron_CommandReply *out_reply);
    // Each attempt of an exam that was just released; NULL: nobody wants to know. From any thread.
    void (*attempt_released)(void *user, struct store *store, const char *session, int number);
    void *attempt_user;
    // An expert's hands at a task on a case, by their places above: an encoded LiveBatch, which the
    // api frees. RESULT_MISSING: the task cannot be done on the case. Takes seconds; from one
    // thread at a time.
    enum result (*rehearse)(void *user, int task, int knee_case, uint8_t **out_batch,
                            size_t *out_size, struct error *err);
    const struct api_cluster *cluster;     // NULL: this server is alone
    const struct signon_settings *sign_on; // NULL: passwords and codes alone
    // What monitors ask for, of watch_user. From any thread. Figures as OpenMetrics, or as
    // Prometheus' text.
    void (*write_figures)(void *user, bool openmetrics, FILE *file);
    // Whether the server lives, or is ready; else one line says why not.
    bool (*lives)(void *user, char out_why[API_WHY_MAX]);
    bool (*is_ready)(void *user, char out_why[API_WHY_MAX]);
    void *watch_user;
};

struct api;

// If no instructor can sign in, logs a link that makes the first one. Only memory holds its secret.
// The link works once, while this server runs and has no instructor. Errors are those of the
// records.
enum result api_create(const struct api_config *config, struct api **out_api, struct error *err);
// Ends what waits for other servers and for the provider of the sign-on, which web_destroy would
// wait for.
void api_break_off(struct api *api);
void api_destroy(struct api **api); // NULL inside is fine

uint64_t api_wrong_sign_ins(const struct api *api); // since the start

// The link's secret; empty if there is an instructor.
const char *api_first_secret(const struct api *api);

// on_request and on_enter of a web_handler; its user is the api. Any threads may call them at the
// same time. They wait for the disk. A request with a password takes some tenths of a second, and
// one for a report takes seconds.
void api_answer(void *api, const struct web_request *request, struct web_response *out_response);
enum result api_enter(void *api, const char *token, struct web_account *out_account);

// is_slow of a web_handler: passwords, reports and rehearsals.
bool api_is_slow(const char *method, const char *path);

// Notes in the audit log that somebody looks at a trainee's session, once in an hour. actor: as
// store_principal's.
void api_note_reading(struct api *api, const char *actor, const char *session);
