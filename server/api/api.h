// What /api/v1 answers (docs/API.md): requests in, responses out, no sockets. Who may come in and
// do what, people, records, cases and stations; it sees no session that runs.
#pragma once

#include "base/result.h"
#include "web/web.h"

#include <stdio.h>

struct api_case {
    const char *name, *dir;
};

struct api_station {
    const char *name, *case_name, *trainee; // trainee: empty where nobody is named
    bool start_by_command;
};

// records: to see its figures beside those of others; NULL: they stand alone. course: of whose
// trainees; NULL: of all. hide_few: as store_figures_on.
struct api_report {
    const char *trace, *records, *course;
    bool hide_few;
};

// All of it must live as long as the api.
struct api_config {
    const char *records;  // the database (store); made where it is not there
    const char *keys_dir; // of the authority (net/authority.h)
    const char *link;     // where its pages are, "https://server.example.org:4880/"; for the log
    const struct api_case *cases;
    int case_count;
    const struct api_station *stations;
    int station_count;
    // Writes a session's page, whole or not at all; from one thread at a time.
    enum result (*report)(const struct api_report *about, FILE *file, struct error *err);
    int port; // that stations call
};

struct api;

// Where no instructor can sign in, a link that makes the first one is logged. Its secret is kept in
// memory alone: it works once, and only as long as this server runs and there is none. Errors are
// those of the records.
enum result api_create(const struct api_config *config, struct api **out_api, struct error *err);
void api_destroy(struct api **api); // NULL inside is fine

// The link's secret, empty: there is an instructor.
const char *api_first_secret(const struct api *api);

// A web_handler's on_request and on_enter, whose user is the api: from any threads, at once. They
// wait for the disk, a request with a password for some tenths of a second too, and one for a
// report for seconds.
void api_answer(void *api, const struct web_request *request, struct web_response *out_response);
enum result api_enter(void *api, const char *token, struct web_account *out_account);
