#include "commands/browsers.h"

#include "api/api.h"
#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "commands/rehearse.h"
#include "commands/watched.h"
#include "live/live.h"
#include "review/page.h"
#include "store/exams.h"
#include "store/store.h"
#include "task/library.h"
#include "web/host_check.h"

#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define LINK_MAX 320

struct browsers {
    struct api_case cases[SESSIONS_CASES_MAX];
    struct error refused[SESSIONS_CASES_MAX]; // why the server could not read them
    struct api_station *stations;
    char link[LINK_MAX];
    const char *records;
    struct api_cluster cluster;
    struct api *api;
    struct live_server *live;
    struct relays *relays; // NULL: this server is alone
    struct web *web;
    struct watched watched;
};

// ---- what the web room asks ---------------------------------------------------------------------

static void on_request(void *user, const struct web_request *request, struct web_response *out) {
    api_answer(((struct browsers *)user)->api, request, out);
}

static bool is_slow(const char *method, const char *path) {
    return api_is_slow(method, path);
}

static enum result on_enter(void *user, const char *token, struct web_account *out_account) {
    return api_enter(((struct browsers *)user)->api, token, out_account);
}

_Static_assert(sizeof(struct live_account) == offsetof(struct web_account, keeps_one) &&
                   LIVE_VIEWERS_MAX == WEB_VIEWERS_MAX && LIVE_BATCH_MAX == WEB_BATCH_MAX,
               "web and live mean the same");

static enum result on_start(void *user, struct lws_context *context, int outgoing,
                            struct error *err) {
    const struct browsers *b = user;
    return b->relays ? relays_begin(b->relays, context, outgoing, err) : RESULT_OK;
}

static void *on_viewer(void *user, const struct web_account *account, const char *token) {
    struct live_account viewer_account;
    memcpy(viewer_account.name, account->name, sizeof viewer_account.name);
    memcpy(viewer_account.role, account->role, sizeof viewer_account.role);
    memcpy(viewer_account.trainee, account->trainee, sizeof viewer_account.trainee);
    return live_server_join(((struct browsers *)user)->live, &viewer_account, token);
}

static bool on_page(void *user, void *viewer, const arthron_Page *message) {
    live_server_take(((struct browsers *)user)->live, viewer, message);
    return true;
}

static size_t on_batch(void *user, void *viewer, int64_t now_ns, uint8_t *out, size_t size,
                       int64_t *out_next_ns) {
    return live_server_batch(((struct browsers *)user)->live, viewer, now_ns, out, size,
                             out_next_ns);
}

static void on_left(void *user, void *viewer) {
    live_server_leave(((struct browsers *)user)->live, viewer);
}

static void ring(void *user) {
    web_wake(user);
}

static void ring_one(void *user, struct viewer *viewer) {
    web_wake_viewer(user, viewer);
}

// ---- what the live server asks ------------------------------------------------------------------

struct ownership {
    const struct live_account *viewer_account;
    bool is_own, is_others; // neither: it is nobody's
    char trace[STORE_TEXT_MAX];
};

static void take_row(void *user, const struct store_cell *cells, int count) {
    struct ownership *o = user;
    for (int i = 0; i < count; i++) {
        if (!strcmp(cells[i].column, "trace") && cells[i].kind == STORE_TEXT)
            snprintf(o->trace, sizeof o->trace, "%s", cells[i].text);
        if (!strcmp(cells[i].column, "trainee") && cells[i].kind == STORE_TEXT) {
            o->is_own =
                o->viewer_account->trainee[0] && !strcmp(cells[i].text, o->viewer_account->trainee);
            o->is_others = !o->is_own;
        }
    }
}

// Instructors see all recorded sessions, trainees their own, except those with an exam that was not
// released. The audit log says who sees others'.
static bool allowed(void *user, const struct live_account *viewer_account, const char *session) {
    const struct browsers *b = user;
    struct ownership ownership = {.viewer_account = viewer_account};
    struct store *store;
    bool withheld = true;
    bool is_instructor = !strcmp(viewer_account->role, store_role_name(ROLE_INSTRUCTOR));
    if (!is_instructor && strcmp(viewer_account->role, store_role_name(ROLE_TRAINEE)) != 0)
        return false;
    if (store_open(b->records, STORE_THERE, viewer_account->name, &store, NULL) == RESULT_OK &&
        store_rows(store, LIST_SESSIONS, session, take_row, &ownership, NULL) == RESULT_OK)
        store_is_withheld(store, session, &withheld, NULL);
    store_close(&store);
    if (is_instructor && ownership.is_others)
        api_note_reading(b->api, viewer_account->name, session);
    bool may = is_instructor || (ownership.is_own && !withheld);
    if (may)
        retention_asked(ownership.trace);
    return may;
}

// Where the records do not say it, nobody learns the name.
static bool is_blind(void *user, const struct live_account *viewer_account, const char *session) {
    const struct browsers *b = user;
    struct store *store;
    bool blind = true;
    if (store_open(b->records, STORE_THERE, viewer_account->name, &store, NULL) == RESULT_OK)
        store_is_blind(store, viewer_account->name, session, &blind, NULL);
    store_close(&store);
    return blind;
}

struct blind_taker {
    take_blind *take;
    void *taker;
};

static void take_pair(void *user, const struct store_cell *cells, int count) {
    const struct blind_taker *t = user;
    if (count == 2 && cells[0].kind == STORE_TEXT && cells[1].kind == STORE_TEXT)
        t->take(t->taker, cells[0].text, cells[1].text);
}

static bool each_blind_pair(void *user, take_blind *take, void *taker) {
    const struct browsers *b = user;
    struct blind_taker blind = {take, taker};
    struct store *store;
    bool known = store_open(b->records, STORE_THERE, "server", &store, NULL) == RESULT_OK &&
                 store_blind_pairs(store, take_pair, &blind, NULL) == RESULT_OK;
    store_close(&store);
    return known;
}

// ---- joining ------------------------------------------------------------------------------------

static const struct knee_case *find_case(void *sessions, uint64_t case_hash) {
    const struct sessions_config *config = sessions_config(sessions);
    for (int i = 0; i < config->case_count; i++) {
        const struct knee_case *knee = scene_case(sessions_scene(sessions, i));
        if (knee->hash == case_hash)
            return knee;
    }
    return NULL;
}

static enum result write_report(void *sessions, const struct api_report *about, FILE *file,
                                struct error *err) {
    struct review_source source = {.trace = about->trace,
                                   .find_case = find_case,
                                   .user = sessions,
                                   .course = about->course,
                                   .hide_few = about->hide_few};
    enum result result = RESULT_OK;
    bool whole;
    if (about->records)
        result = store_open(about->records, STORE_THERE, "server", &source.records, err);
    if (result == RESULT_OK)
        result = review_write_page(&source, file, &whole, err);
    store_close(&source.records);
    return result;
}

// The case is read twice there.
static enum result rehearse_task(void *sessions, int task, int knee_case, uint8_t **out_batch,
                            size_t *out_size, struct error *err) {
    const struct sessions_config *config = sessions_config(sessions);
    const char *name = library_tasks(sessions_tasks(sessions))[task].name;
    char path[SESSIONS_PATH_MAX + TASK_NAME_MAX + 8];
    snprintf(path, sizeof path, "%s/%s.ini", config->tasks_dir, name);
    const struct rehearse_request request = {.task = path,
                                             .dir = config->cases[knee_case].dir,
                                             .case_name = config->cases[knee_case].name,
                                             .memory_mb = 2 * config->case_memory_mb};
    return rehearse_apart(&request, out_batch, out_size, err);
}

// What a browser calls the server: its first name, else its address, else the machine's name where
// its certificate has that, else what that has.
static enum result make_link(const struct web_settings *web, char out[LINK_MAX],
                             struct error *err) {
    static const char *const no_names[] = {NULL};
    char host[256] = "", machine[256] = "localhost";
    struct host_check *hosts;
    if (web->is_plain) {
        snprintf(out, LINK_MAX, "http://localhost:%d/", web->port);
        return RESULT_OK;
    }
    enum result result = host_check_create(web->certificate, no_names, &hosts, err);
    if (result != RESULT_OK)
        return result;
    gethostname(machine, sizeof machine - 1);
    if (web->names[0][0])
        snprintf(host, sizeof host, "%s", web->names[0]);
    else if (web->address[0] && strcmp(web->address, "0.0.0.0") && strcmp(web->address, "::"))
        snprintf(host, sizeof host, strchr(web->address, ':') ? "[%s]" : "%s", web->address);
    else
        host_check_public_name(hosts, machine, host, sizeof host);
    host_check_destroy(&hosts);
    snprintf(out, LINK_MAX, "https://%s:%d/", host, web->port);
    return RESULT_OK;
}

static struct api_case case_of(struct browsers *b, struct sessions *sessions, int index) {
    const struct session_case *served = &sessions_config(sessions)->cases[index];
    struct error *why = &b->refused[index];
    char text[sizeof why->text];
    if (sessions_case_is_broken(sessions, index, why)) { // a page knows which case it is
        size_t length = (size_t)snprintf(text, sizeof text, "case %s: ", served->name);
        if (!strncmp(why->text, text, length))
            memmove(why->text, why->text + length, strlen(why->text + length) + 1);
    }
    return (struct api_case){served->name, served->dir, scene_case(sessions_scene(sessions, index)),
                             why->text};
}

static void tell_self(void *cluster, struct cluster_peer *out) {
    cluster_self(cluster, out);
}

static int list_peers(void *cluster, struct cluster_peer *out, int room) {
    return cluster_peers(cluster, out, room);
}

static void find_server(void *cluster, int station, char out_name[SERVER_NAME_SIZE]) {
    cluster_server_name(cluster, station, out_name);
}

static enum result open_api(struct browsers *b, const struct signon_settings *sign_on,
                            struct sessions *sessions, struct error *err) {
    const struct sessions_config *served = sessions_config(sessions);
    for (int i = 0; i < served->case_count; i++)
        b->cases[i] = case_of(b, sessions, i);
    b->stations = alloc((size_t)served->station_count, sizeof *b->stations);
    for (int i = 0; i < served->station_count; i++) {
        const struct session_station *station = &served->stations[i];
        b->stations[i] = (struct api_station){station->name, station->case_name, station->trainee,
                                              station->start_by_command};
    }
    struct cluster *cluster = sessions_cluster(sessions);
    b->cluster =
        (struct api_cluster){cluster, tell_self, list_peers, find_server, served->traces_dir};
    const struct api_config config = {
        .cluster = cluster ? &b->cluster : NULL,
        .sign_on = sign_on->issuer[0] ? sign_on : NULL,
        .records = served->records,
        .keys_dir = served->keys_dir,
        .link = b->link,
        .cases = b->cases,
        .case_count = served->case_count,
        .stations = b->stations,
        .station_count = served->station_count,
        .report = write_report,
        .command = sessions_command,
        .user = sessions,
        .attempt_released = served->attempt_written,
        .attempt_user = served->attempt_user,
        .rehearse = rehearse_task,
        .check_case = served->check_case,
        .port = served->port,
        .tasks = library_tasks(sessions_tasks(sessions)),
        .task_count = library_count(sessions_tasks(sessions)),
        .write_figures = watched_write,
        .lives = watched_lives,
        .is_ready = watched_is_ready,
        .watch_user = &b->watched,
    };
    enum result result = api_create(&config, &b->api, err);
    b->watched = (struct watched){sessions, b->api, &b->web, clock_now_ns()};
    return result;
}

static enum result open_web(struct browsers *b, const struct web_settings *settings,
                            struct error *err) {
    const struct web_handler handler = {
        .user = b,
        .on_request = on_request,
        .is_slow = is_slow,
        .on_enter = on_enter,
        .on_viewer = on_viewer,
        .on_page = on_page,
        .on_batch = on_batch,
        .on_left = on_left,
        .on_start = on_start,
    };
    struct web_config config = {
        .address = settings->address[0] ? settings->address : NULL,
        .port = settings->port,
        .certificate = settings->is_plain ? NULL : settings->certificate,
        .key = settings->is_plain ? NULL : settings->key,
        .pages = web_pages_built_in,
        .outgoing = b->relays ? RELAYS_MAX : 0,
    };
    for (int i = 0; i < SERVER_NAMES_MAX && settings->names[i][0]; i++)
        config.names[i] = settings->names[i];
    return web_create(&config, &handler, &b->web, err);
}

static enum result open_live(struct browsers *b, struct sessions *sessions, struct error *err) {
    const struct sessions_config *served = sessions_config(sessions);
    char authority[SESSIONS_PATH_MAX + 16];
    enum result result = RESULT_OK;
    snprintf(authority, sizeof authority, "%s/authority.pem", served->keys_dir);
    if (served->cluster.jet.name[0])
        result = relays_create(authority, &b->relays, err);
    const struct live_config config = {.user = b,
                                       .allowed = allowed,
                                       .is_blind = is_blind,
                                       .each_blind = each_blind_pair,
                                       .relays = b->relays};
    b->live = live_server_create(sessions, &config);
    return result;
}

enum result browsers_create(const struct server_config *config, struct sessions *sessions,
                            struct browsers **out_browsers, struct error *err) {
    struct browsers *b = alloc(1, sizeof *b);
    b->records = config->sessions.records;
    enum result result = open_live(b, sessions, err);
    if (result == RESULT_OK)
        result = make_link(&config->web, b->link, err);
    if (result == RESULT_OK)
        result = open_api(b, &config->sign_on, sessions, err);
    if (result == RESULT_OK)
        result = open_web(b, &config->web, err);
    if (result == RESULT_OK)
        live_server_on_news(b->live, ring, ring_one, b->web);
    if (result == RESULT_OK)
        log_info("server", "browsers are served at %s", b->link);
    else
        browsers_destroy(&b);
    *out_browsers = b;
    return result;
}

void browsers_destroy(struct browsers **browsers) {
    struct browsers *b = *browsers;
    if (!b)
        return;
    live_server_on_news(b->live, NULL, NULL, NULL);
    rehearse_break_off();
    if (b->api)
        api_break_off(b->api);
    if (b->web)
        web_destroy(&b->web);
    live_server_destroy(&b->live);
    relays_destroy(&b->relays);
    api_destroy(&b->api);
    free(b->stations);
    free(b);
    *browsers = NULL;
}
