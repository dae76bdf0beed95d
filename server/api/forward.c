#include "api/forward.h"

#include "api/servers.h"
#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"

#include <fcntl.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <sys/statvfs.h>
#include <unistd.h>

#define OF_ONE_SERVER_MAX (WEB_LATER_THREADS / 2) // so that one that hangs does not hold up all
#define FILES_MAX (OF_ONE_SERVER_MAX / 2)         // of these: files take long
#define DISK_RESERVE (INT64_C(1) << 30)           // bytes of the disk that no file takes
#define BYTES_MAX (32 << 20)                      // of an answer that is no file
#define SILENCE_S 20
#define SLOW_SILENCE_S 90 // while it makes a report
#define QUICK_S 120
#define FILE_S 3600
#define UNKNOWN_NS NS_PER_S // until a cookie that was made here is known there
#define RETRY_US 100000

struct forwards {
    struct peers *peers;
    char authority[PATH_MAX];
    pthread_mutex_t lock;
    struct place {
        char server[SERVER_NAME_SIZE]; // that is asked; empty: it is free
        char owner[64];                // of a file; else empty
    } places[WEB_LATER_THREADS];
};

// A copy of a request.
struct forward {
    struct api *api;
    struct cluster_peer to;
    bool is_file, is_slow;
    char method[8], path[3 * 512], range[64], if_range[96];
    char *query, *token, *body; // body: NULL where there is none
    size_t size;
    char owner[64];
};

// ---- life ---------------------------------------------------------------------------------------

struct forwards *forwards_create(const char *keys_dir) {
    struct forwards *forwards = alloc(1, sizeof *forwards);
    snprintf(forwards->authority, sizeof forwards->authority, "%s/authority.pem", keys_dir);
    forwards->peers = peers_create(forwards->authority);
    pthread_mutex_init(&forwards->lock, NULL);
    return forwards;
}

void forwards_break_off(struct forwards *forwards) {
    peers_break_off(forwards->peers);
}

void forwards_destroy(struct forwards **forwards) {
    struct forwards *r = *forwards;
    if (!r)
        return;
    peers_destroy(&r->peers);
    pthread_mutex_destroy(&r->lock);
    free(r);
    *forwards = NULL;
}

static void release(struct forward *r) {
    free(r->query);
    free(r->token);
    free(r->body);
    free(r);
}

// ---- an answer ----------------------------------------------------------------------------------

static void refuse(struct web_response *response, const char *code, const char *name,
                   const char *why) {
    struct api_call call = {.response = response};
    call_refuse(&call, 503, code, NULL, "Server %s has this, and %s.", name, why);
    response->retry_after_s = 2;
}

// A file without a name, so that nothing stays of it. All that are open at once leave the reserve.
static FILE *open_file(const char *folder, int64_t *out_most) {
    struct statvfs free_now;
    int fd = open(folder, O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
    FILE *file = fd >= 0 ? fdopen(fd, "w+") : NULL;
    if (file && !fstatvfs(fd, &free_now)) {
        int64_t bytes = (int64_t)(free_now.f_bavail * free_now.f_frsize) - DISK_RESERVE;
        *out_most = bytes > 0 ? bytes / WEB_LATER_THREADS : 0;
        return file;
    }
    if (file)
        fclose(file);
    else if (fd >= 0)
        close(fd);
    return NULL;
}

static void describe(const struct forward *r, const struct peer_answer *answer,
                     struct web_response *out) {
    out->status = answer->status;
    out->retry_after_s = answer->retry_after_s;
    out->stands_alone = out->compress = !strncmp(answer->type, "text/html", 9);
    memcpy(out->type, answer->type, sizeof out->type);
    memcpy(out->download, answer->download, sizeof out->download);
    memcpy(out->content_range, answer->content_range, sizeof out->content_range);
    memcpy(out->owner, r->owner, sizeof out->owner);
}

static struct peer_request request_of(const struct forward *r) {
    return (struct peer_request){.pages = r->to.pages,
                                 .method = r->method,
                                 .path = r->path,
                                 .query = r->query,
                                 .token = r->token,
                                 .via = "1.1 " WEB_VIA,
                                 .body = r->body,
                                 .size = r->size,
                                 .range = r->range[0] ? r->range : NULL,
                                 .if_range = r->if_range[0] ? r->if_range : NULL,
                                 .most = BYTES_MAX,
                                 .silence_s = r->is_slow ? SLOW_SILENCE_S : SILENCE_S,
                                 .patience_s = r->is_file ? FILE_S : QUICK_S};
}

// Takes the body. *out: all zero after an error.
static enum result ask_into(const struct forward *r, const struct peer_request *request, FILE *body,
                            struct web_response *out, struct error *err) {
    struct peer_answer answer;
    enum result result = peer_ask(r->api->forwards->peers, request, body, &answer, err);
    if (result == RESULT_OK && (answer.status < 200 || answer.status > 599))
        result = fail(err, RESULT_FORMAT, "status %d", answer.status);
    *out = (struct web_response){0};
    if (result == RESULT_OK)
        describe(r, &answer, out);
    if (result == RESULT_OK && r->is_file)
        out->open_file = body;
    else
        fclose(body);
    return result;
}

static enum result ask_once(const struct forward *r, struct web_response *out, struct error *err) {
    char *bytes = NULL;
    size_t size = 0;
    struct peer_request request = request_of(r);
    FILE *body = r->is_file ? open_file(r->api->config.cluster->folder, &request.most)
                            : open_memstream(&bytes, &size);
    if (!body)
        return fail(err, RESULT_IO, "a file for what server %s answers cannot be made", r->to.name);
    enum result result = ask_into(r, &request, body, out, err);
    if (result == RESULT_OK && !r->is_file && out->status != 204) {
        out->body = bytes;
        out->size = size;
    } else {
        free(bytes);
    }
    return result;
}

static void forget(struct web_response *response) {
    free(response->body);
    if (response->open_file)
        fclose(response->open_file);
    *response = (struct web_response){0};
}

static enum result ask_peer(const struct forward *r, struct web_response *out, struct error *err) {
    int64_t until_ns = clock_now_ns() + UNKNOWN_NS;
    enum result result;
    while ((result = ask_once(r, out, err)) == RESULT_OK && out->status == 401 &&
           clock_now_ns() < until_ns) {
        forget(out);
        usleep(RETRY_US);
    }
    return result;
}

// ---- a thread that may wait ---------------------------------------------------------------------

// Who asks for a file has one place.
static struct place *free_place(struct forwards *forwards, const struct forward *r) {
    struct place *found = NULL;
    int count = 0, files = 0, own = 0;
    for (int i = 0; i < WEB_LATER_THREADS; i++) {
        struct place *place = &forwards->places[i];
        if (!place->server[0])
            found = place;
        if (strcmp(place->server, r->to.name) != 0)
            continue;
        count++;
        files += place->owner[0] != '\0';
        own += place->owner[0] && !strcmp(place->owner, r->owner);
    }
    bool has_room = count < OF_ONE_SERVER_MAX && (!r->is_file || (files < FILES_MAX && !own));
    return has_room ? found : NULL;
}

static struct place *occupy_place(struct forwards *forwards, const struct forward *r) {
    pthread_mutex_lock(&forwards->lock);
    struct place *place = free_place(forwards, r);
    if (place) {
        memcpy(place->server, r->to.name, sizeof place->server);
        memcpy(place->owner, r->owner, sizeof place->owner);
    }
    pthread_mutex_unlock(&forwards->lock);
    return place;
}

static void vacate(struct forwards *forwards, struct place *place) {
    pthread_mutex_lock(&forwards->lock);
    *place = (struct place){0};
    pthread_mutex_unlock(&forwards->lock);
}

static void answer(const struct forward *r, struct web_response *out) {
    struct error err;
    struct place *place = occupy_place(r->api->forwards, r);
    if (!place) {
        refuse(out, "busy", r->to.name, "is asked for too much");
        return;
    }
    enum result result = ask_peer(r, out, &err);
    vacate(r->api->forwards, place);
    if (result == RESULT_OK)
        return;
    if (result != RESULT_CLOSED)
        log_warning("api", "server %s: %s", r->to.name, err.text);
    refuse(out, "away", r->to.name, "does not answer");
}

static void run_forward(void *data, struct web_response *out) {
    struct forward *r = data;
    if (out)
        answer(r, out);
    release(r);
}

// ---- which server -------------------------------------------------------------------------------

// Empty: this one.
static void find_name(struct api_call *call, const struct route *route,
                      char out_name[SERVER_NAME_SIZE]) {
    const struct api_config *config = &call->api->config;
    out_name[0] = '\0';
    for (int i = 0; route->place == AT_STATION && i < config->station_count; i++)
        if (!strcmp(config->stations[i].name, call->args[0]))
            config->cluster->server_of(config->cluster->user, i, out_name);
    if (route->place == AT_TRACE)
        session_server(call, out_name);
}

static bool find_peer(const struct api *api, const char *name, struct cluster_peer *out) {
    struct cluster_peer *peers;
    int count = servers_read(api, &peers), i = 0;
    while (i < count && strcmp(peers[i].name, name) != 0)
        i++;
    bool found = i < count && peers[i].lives;
    if (found)
        *out = peers[i];
    free(peers);
    return found;
}

static struct forward *copy(const struct api_call *call, const struct route *route,
                            const struct cluster_peer *to) {
    const struct web_request *request = call->request;
    struct forward *r = alloc(1, sizeof *r);
    r->api = call->api;
    r->to = *to;
    r->is_slow = route->slow;
    r->is_file = route->answer == get_session_trace;
    snprintf(r->method, sizeof r->method, "%s", request->method);
    bool fits = peer_escape(request->path, r->path, sizeof r->path);
    CHECK(fits);
    snprintf(r->range, sizeof r->range, "%s", request->range ? request->range : "");
    snprintf(r->if_range, sizeof r->if_range, "%s", request->if_range ? request->if_range : "");
    r->query = alloc_text(request->query);
    r->token = alloc_text(request->token);
    if (request->size) {
        r->body = alloc(request->size, 1);
        r->size = request->size;
        memcpy(r->body, request->body, request->size);
    }
    if (r->is_file)
        snprintf(r->owner, sizeof r->owner, "%s", call->principal.actor);
    return r;
}

bool forward_takes(struct api_call *call, const struct route *route) {
    char name[SERVER_NAME_SIZE];
    struct cluster_peer self, to;
    const struct api_cluster *cluster = call->api->config.cluster;
    if (!cluster || route->place == HERE || call->request->is_passed_on)
        return false;
    find_name(call, route, name);
    cluster->self(cluster->user, &self);
    if (!name[0] || !strcmp(name, self.name))
        return false;
    if (!find_peer(call->api, name, &to) || !to.pages[0]) {
        refuse(call->response, "away", name, "is away");
        return true;
    }
    call->response->later = run_forward;
    call->response->later_data = copy(call, route, &to);
    return true;
}

// ---- by its secret ------------------------------------------------------------------------------

enum result forward_ask(struct api *api, const struct cluster_peer *peer, const char *path,
                        json_t *body, json_t **out_json, struct error *err) {
    char *text = json_dumps(body, JSON_COMPACT), *bytes = NULL;
    size_t size = 0;
    struct peer_answer answer;
    NEED(text, "memory");
    FILE *file = open_memstream(&bytes, &size);
    NEED(file, "memory");
    const struct peer_request request = {.pages = peer->pages,
                                         .method = "POST",
                                         .path = path,
                                         .query = "",
                                         .token = peer->secret,
                                         .body = text,
                                         .size = strlen(text),
                                         .most = WEB_BODY_MAX,
                                         .silence_s = SILENCE_S,
                                         .patience_s = SILENCE_S};
    enum result result = peer_ask(api->forwards->peers, &request, file, &answer, err);
    fclose(file);
    if (result == RESULT_OK && answer.status != 200)
        result = fail(err, RESULT_REFUSED, "https://%s: status %d", peer->pages, answer.status);
    *out_json = result == RESULT_OK ? json_loadb(bytes, size, JSON_REJECT_DUPLICATES, NULL) : NULL;
    free(bytes);
    free(text);
    return result;
}
