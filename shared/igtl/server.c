#include "igtl/server.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "base/newest.h"
#include "base/ring.h"
#include "igtl/client.h"
#include "websocket/ws_server.h"

#include <arpa/inet.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define ITEMS 256
#define SPARE_DESCRIPTORS 4 // a client that is turned away has one for a moment

static const int64_t silence_ns = IGTL_SILENCE_S * NS_PER_S;

enum item_kind { ITEM_POSES, ITEM_STRING, ITEM_STATE };

// On its way to the server's thread.
struct item {
    enum item_kind kind;
    int64_t put_ns;
    union {
        struct igtl_poses poses;
        struct served_string string;
        struct igtl_state state;
    };
};

struct mesh_put {
    char name[IGTL_DEVICE_SIZE]; // empty: no mesh
    bool is_empty, fresh;
    int64_t utc_ns;
    struct served_bytes *content; // fresh: for the server's thread
};

struct place {
    struct lws *socket; // NULL: free
    struct igtl_client *client;
    int number;
    int64_t waits_since_ns; // for its connection; 0: it does not
};

struct igtl_server {
    struct ws_server *server;
    struct ring *items;
    struct newest *unwatched; // a set while nobody is there
    atomic_int client_count;
    pthread_mutex_t lock; // for meshes
    struct mesh_put meshes[IGTL_MESHES_MAX];
    // The server's thread only.
    int last_number;
    struct item item;
    struct served served;
    struct place places[IGTL_CLIENTS_MAX];
};

// ---- clients ------------------------------------------------------------------------------------

static struct place *find_place(struct igtl_server *s, const struct lws *socket) {
    for (int i = 0; i < IGTL_CLIENTS_MAX; i++)
        if (s->places[i].socket == socket)
            return &s->places[i];
    return NULL;
}

static void take_unwatched(struct igtl_server *s) {
    struct igtl_poses poses;
    if (newest_take(s->unwatched, &poses))
        served_put_poses(&s->served, &poses, clock_now_ns());
}

static void ask_writable(struct place *place) {
    lws_callback_on_writable(place->socket);
    if (!place->waits_since_ns)
        place->waits_since_ns = clock_now_ns();
}

static int let_in(struct igtl_server *s, struct lws *socket) {
    struct place *place = find_place(s, NULL);
    char peer[64] = "";
    if (!place) {
        log_warning("openigtlink", "a client was turned away: %d are there", IGTL_CLIENTS_MAX);
        return -1;
    }
    take_unwatched(s);
    lws_set_timeout(socket, NO_PENDING_TIMEOUT, 0);
    ws_keep_queue_short(socket);
    *place = (struct place){.socket = socket, .number = ++s->last_number};
    place->client = igtl_client_create(&s->served, place->number);
    atomic_fetch_add(&s->client_count, 1);
    log_info("openigtlink", "client %d: connected from %s", place->number,
             lws_get_peer_simple(socket, peer, sizeof peer));
    ask_writable(place);
    return 0;
}

static int let_go(struct igtl_server *s, const struct lws *socket) {
    struct place *place = find_place(s, socket);
    if (!place)
        return 0;
    log_info("openigtlink", "client %d: gone", place->number);
    igtl_client_destroy(&place->client);
    place->socket = NULL;
    atomic_fetch_sub(&s->client_count, 1);
    return 0;
}

static int hear(struct igtl_server *s, struct lws *socket, const uint8_t *bytes, size_t size) {
    struct place *place = find_place(s, socket);
    struct error err;
    if (!place)
        return -1;
    if (igtl_client_hear(place->client, bytes, size, &err) != RESULT_OK) {
        log_warning("openigtlink", "client %d: dropped: %s", place->number, err.text);
        return -1;
    }
    if (igtl_client_waits(place->client))
        ask_writable(place);
    return 0;
}

static int send_waiting(struct igtl_server *s, struct lws *socket) {
    struct place *place = find_place(s, socket);
    if (!place)
        return -1;
    place->waits_since_ns = 0;
    while (!lws_send_pipe_choked(socket)) {
        const uint8_t *bytes;
        size_t size = igtl_client_next(place->client, clock_now_ns(), &bytes);
        if (!size)
            return 0;
        if (lws_write(socket, (unsigned char *)bytes, size, LWS_WRITE_RAW) < (int)size)
            return -1;
    }
    igtl_client_choked(place->client);
    ask_writable(place);
    return 0;
}

static void drop(const struct place *place, const char *why) {
    log_warning("openigtlink", "client %d: dropped: %s", place->number, why);
    lws_set_timeout(place->socket, PENDING_TIMEOUT_USER_OK, LWS_TO_KILL_ASYNC);
}

// ---- the server's thread ------------------------------------------------------------------------

static void take_item(struct igtl_server *s) {
    switch (s->item.kind) {
    case ITEM_POSES:
        served_put_poses(&s->served, &s->item.poses, s->item.put_ns);
        break;
    case ITEM_STRING:
        served_put_string(&s->served, &s->item.string);
        break;
    case ITEM_STATE:
        served_put_state(&s->served, &s->item.state);
        break;
    }
}

static void take_meshes(struct igtl_server *s) {
    for (int i = 0; i < IGTL_MESHES_MAX; i++) {
        pthread_mutex_lock(&s->lock);
        struct mesh_put mesh = s->meshes[i];
        s->meshes[i].fresh = false;
        s->meshes[i].content = NULL;
        pthread_mutex_unlock(&s->lock);
        if (mesh.fresh)
            served_put_mesh(&s->served, i, mesh.name, mesh.utc_ns, mesh.content);
    }
}

static void on_wake(void *user) {
    struct igtl_server *s = user;
    while (ring_pop(s->items, &s->item))
        take_item(s);
    take_meshes(s);
    for (int i = 0; i < IGTL_CLIENTS_MAX; i++)
        if (s->places[i].socket && igtl_client_waits(s->places[i].client))
            ask_writable(&s->places[i]);
}

// At least once a second.
static void after_turn(void *user) {
    struct igtl_server *s = user;
    int64_t now_ns = clock_now_ns();
    for (int i = 0; i < IGTL_CLIENTS_MAX; i++) {
        struct place *place = &s->places[i];
        if (!place->socket)
            continue;
        if (igtl_client_is_full(place->client))
            drop(place, "it does not read, and too many strings wait for it");
        else if (place->waits_since_ns && now_ns - place->waits_since_ns > silence_ns)
            drop(place, "it does not read");
    }
}

static bool is_empty(void *user) {
    struct igtl_server *s = user;
    bool empty = true;
    for (int i = 0; i < IGTL_CLIENTS_MAX; i++)
        empty &= !s->places[i].socket || !s->places[i].waits_since_ns;
    return empty;
}

static int on_event(struct lws *socket, enum lws_callback_reasons reason, void *user, void *bytes,
                    size_t size) {
    (void)user;
    struct igtl_server *s = lws_context_user(lws_get_context(socket));
    switch (reason) {
    case LWS_CALLBACK_RAW_ADOPT:
        return let_in(s, socket);
    case LWS_CALLBACK_RAW_RX:
        return hear(s, socket, bytes, size);
    case LWS_CALLBACK_RAW_WRITEABLE:
        return send_waiting(s, socket);
    case LWS_CALLBACK_RAW_CLOSE:
        return let_go(s, socket);
    default:
        return 0;
    }
}

// ---- life ---------------------------------------------------------------------------------------

static const struct lws_protocols protocols[] = {
    {.name = "openigtlink", .callback = on_event, .rx_buffer_size = 4096},
    {0},
};

static enum result listen_at(struct igtl_server *s, const struct igtl_server_config *config,
                             struct error *err) {
    const char *address = config->address[0] ? config->address : "127.0.0.1";
    uint8_t number[sizeof(struct in6_addr)];
    const struct lws_context_creation_info info = {
        .iface = address,
        .port = config->port,
        .protocols = protocols,
        .fd_limit_per_thread = IGTL_CLIENTS_MAX + SPARE_DESCRIPTORS,
        .vhost_name = "openigtlink",
    };
    const struct ws_server_handler handler = {
        .user = s, .on_wake = on_wake, .is_empty = is_empty, .after_turn = after_turn};
    if (inet_pton(strchr(address, ':') ? AF_INET6 : AF_INET, address, number) != 1)
        return fail(err, RESULT_INVALID, "openigtlink: %s is no address", address);
    if (ws_server_create(WS_SERVER_RAW, &info, &handler, &s->server, err) == RESULT_OK)
        return RESULT_OK;
    return fail_in(err, RESULT_IO, "openigtlink: ");
}

static void release(struct igtl_server *s) {
    ws_server_destroy(&s->server);
    for (int i = 0; i < IGTL_MESHES_MAX; i++)
        served_bytes_release(&s->meshes[i].content);
    served_fini(&s->served);
    pthread_mutex_destroy(&s->lock);
    newest_destroy(&s->unwatched);
    ring_destroy(&s->items);
    free(s);
}

enum result igtl_server_create(const struct igtl_server_config *config,
                               struct igtl_server **out_server, struct error *err) {
    struct igtl_server *s = alloc(1, sizeof *s);
    s->items = ring_create(ITEMS, sizeof(struct item));
    s->unwatched = newest_create(sizeof(struct igtl_poses));
    pthread_mutex_init(&s->lock, NULL);
    memcpy(s->served.device, config->device, sizeof s->served.device);
    s->served.interval_ns = config->rate_hz > 0 ? (int64_t)(NS_PER_S / config->rate_hz) : 0;
    *out_server = NULL;
    enum result result = listen_at(s, config, err);
    if (result != RESULT_OK) {
        release(s);
        return result;
    }
    ws_server_start(s->server);
    *out_server = s;
    return RESULT_OK;
}

void igtl_server_destroy(struct igtl_server **server) {
    if (!*server)
        return;
    ws_server_stop((*server)->server);
    release(*server);
    *server = NULL;
}

int igtl_server_port(const struct igtl_server *s) {
    return ws_server_port(s->server);
}

int igtl_server_clients(const struct igtl_server *s) {
    return atomic_load(&s->client_count);
}

// ---- the caller's thread ------------------------------------------------------------------------

static bool put(struct igtl_server *s, struct item *item) {
    item->put_ns = clock_now_ns();
    bool taken = ring_push(s->items, item);
    ws_server_wake(s->server);
    return taken;
}

bool igtl_server_put_poses(struct igtl_server *s, const struct igtl_poses *poses) {
    CHECK(poses->count >= 0 && poses->count <= IGTL_POSES_MAX);
    if (!igtl_server_clients(s)) {
        newest_put(s->unwatched, poses);
        return true;
    }
    struct item item = {.kind = ITEM_POSES, .poses = *poses};
    return put(s, &item);
}

bool igtl_server_put_string(struct igtl_server *s, const char *device, const char *text,
                            int64_t utc_ns) {
    struct item item = {.kind = ITEM_STRING, .string.utc_ns = utc_ns};
    if (!igtl_server_clients(s))
        return true;
    snprintf(item.string.device, sizeof item.string.device, "%s", device);
    snprintf(item.string.text, sizeof item.string.text, "%s", text);
    return put(s, &item);
}

bool igtl_server_put_status(struct igtl_server *s, const struct igtl_state *state) {
    struct item item = {.kind = ITEM_STATE, .state = *state};
    return put(s, &item);
}

// ---- any thread ---------------------------------------------------------------------------------

static struct served_bytes *encode_served(const struct igtl_mesh *mesh) {
    CHECK(mesh->vertex_count >= 0 && mesh->vertex_count <= IGTL_VERTICES_MAX &&
          mesh->triangle_count >= 0 && mesh->triangle_count <= IGTL_VERTICES_MAX);
    for (size_t i = 0; i < 3 * (size_t)mesh->triangle_count; i++)
        CHECK(mesh->triangles[i] < (uint32_t)mesh->vertex_count);
    struct served_bytes *content =
        served_bytes_create(igtl_polydata_size(mesh->vertex_count, mesh->triangle_count));
    igtl_write_polydata(mesh->positions, mesh->vertex_count, mesh->triangles, mesh->triangle_count,
                        content->bytes);
    return content;
}

// Its own place, else one that nobody has, else an empty mesh's.
static struct mesh_put *place_of(struct igtl_server *s, const char *name) {
    struct mesh_put *unused = NULL, *empty = NULL;
    for (int i = IGTL_MESHES_MAX - 1; i >= 0; i--) {
        struct mesh_put *mesh = &s->meshes[i];
        if (!strcmp(mesh->name, name))
            return mesh;
        if (!mesh->name[0])
            unused = mesh;
        else if (mesh->is_empty)
            empty = mesh;
    }
    CHECK(unused || empty);
    return unused ? unused : empty;
}

void igtl_server_put_mesh(struct igtl_server *s, const struct igtl_mesh *mesh) {
    CHECK(mesh->name[0]);
    struct served_bytes *content = encode_served(mesh);
    pthread_mutex_lock(&s->lock);
    struct mesh_put *place = place_of(s, mesh->name);
    struct served_bytes *before = place->content;
    *place = (struct mesh_put){.is_empty = !mesh->triangle_count,
                               .fresh = true,
                               .utc_ns = mesh->utc_ns,
                               .content = content};
    memcpy(place->name, mesh->name, sizeof place->name);
    pthread_mutex_unlock(&s->lock);
    served_bytes_release(&before);
    ws_server_wake(s->server);
}
