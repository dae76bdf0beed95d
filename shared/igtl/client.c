#include "igtl/client.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "igtl/content.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { STATUS_OK = 1, STATUS_NOT_FOUND = 4 };

// A client whose connection was full goes on with the newest set where the next one is so old.
static const int64_t stale_ns = 250 * NS_PER_MS;

static const char *const capabilities[] = {
    "TRANSFORM",   "TDATA",     "QTDATA",     "POLYDATA",   "STRING",       "STATUS",
    "CAPABILITY",  "GET_TRANS", "GET_TDATA",  "GET_QTDATA", "GET_POLYDATA", "GET_STATUS",
    "GET_CAPABIL", "STT_TDATA", "STT_QTDATA", "STP_TDATA",  "STP_QTDATA"};

struct pending {
    struct igtl_query query;
    bool failed;
};

struct igtl_client {
    struct served *served;
    int number, version;
    bool told_version, told_malformed; // in the log

    enum igtl_type wanted; // TRANSFORM, TDATA or QTDATA
    int64_t interval_ns, due_ns;
    bool choked;
    bool mesh_before_set;                                    // they take turns
    uint64_t sets, strings, states, meshes[IGTL_MESHES_MAX]; // numbers of what it got last
    struct served_bytes *sending; // a mesh's message, of which so much was given out
    size_t sent;

    int query_count;
    struct pending queries[IGTL_CLIENT_QUERIES_MAX];
    struct igtl_framing framing;
    uint8_t bytes[IGTL_CLIENT_BYTES_MAX];
};

struct igtl_client *igtl_client_create(struct served *served, int number) {
    struct igtl_client *c = alloc(1, sizeof *c);
    c->served = served;
    c->number = number;
    c->version = 1;
    c->interval_ns = served->interval_ns;
    c->sets = served->set_count ? served->set_count - 1 : 0;
    c->strings = served->string_count;
    igtl_framing_init(&c->framing);
    return c;
}

void igtl_client_destroy(struct igtl_client **client) {
    if (!*client)
        return;
    served_bytes_release(&(*client)->sending);
    free(*client);
    *client = NULL;
}

// ---- what it asks for ---------------------------------------------------------------------------

static void hear_version(struct igtl_client *c, int version) {
    int ours = version < IGTL_NEWEST_VERSION ? version : IGTL_NEWEST_VERSION;
    if (ours > c->version)
        c->version = ours;
    if (version > IGTL_NEWEST_VERSION && !c->told_version)
        log_warning("openigtlink", "client %d: its messages of version %d are passed over",
                    c->number, version);
    c->told_version |= version > IGTL_NEWEST_VERSION;
}

static void tell_malformed(struct igtl_client *c, const char *why) {
    if (!c->told_malformed)
        log_warning("openigtlink", "client %d: %s", c->number, why);
    c->told_malformed = true;
}

static void start(struct igtl_client *c, const struct igtl_query *query) {
    c->wanted = query->type;
    c->interval_ns = query->interval_ms * NS_PER_MS;
    c->due_ns = 0;
}

static void stop(struct igtl_client *c, const struct igtl_query *query) {
    if (c->wanted != query->type)
        return;
    c->wanted = IGTL_TYPE_TRANSFORM;
    c->interval_ns = c->served->interval_ns;
}

static enum result take_frame(struct igtl_client *c, const struct igtl_frame *frame,
                              struct error *err) {
    struct igtl_query query;
    struct error problem;
    hear_version(c, frame->version);
    if (!frame->known)
        return RESULT_OK;
    enum result result = igtl_query_read(frame, &query, &problem);
    if (result != RESULT_OK)
        tell_malformed(c, problem.text);
    if (query.kind == IGTL_QUERY_OTHER || (result != RESULT_OK && query.kind == IGTL_QUERY_GET))
        return RESULT_OK;
    if (c->query_count == IGTL_CLIENT_QUERIES_MAX)
        return fail(err, RESULT_LIMIT, "it takes no answers to its requests");
    c->queries[c->query_count++] = (struct pending){query, result != RESULT_OK};
    if (result == RESULT_OK && query.kind == IGTL_QUERY_START)
        start(c, &query);
    if (result == RESULT_OK && query.kind == IGTL_QUERY_STOP)
        stop(c, &query);
    return RESULT_OK;
}

enum result igtl_client_hear(struct igtl_client *c, const uint8_t *bytes, size_t size,
                             struct error *err) {
    while (size) {
        struct igtl_frame frame;
        enum igtl_framing_event event;
        size_t taken = igtl_framing_feed(&c->framing, bytes, size, &event, &frame, err);
        if (event == IGTL_FRAMING_BROKEN)
            return RESULT_LIMIT;
        if (event == IGTL_FRAMING_MESSAGE && take_frame(c, &frame, err) != RESULT_OK)
            return RESULT_LIMIT;
        bytes += taken;
        size -= taken;
    }
    return RESULT_OK;
}

// ---- messages -----------------------------------------------------------------------------------

static struct igtl_head head_of(const struct igtl_client *c, const char *type, const char *device,
                                int64_t utc_ns) {
    return (struct igtl_head){
        .version = c->version, .type = type, .device = device, .stamp = igtl_stamp(utc_ns)};
}

static uint8_t *content(struct igtl_client *c) {
    return c->bytes + igtl_message_content(c->version);
}

static const char *status_of(const struct igtl_pose *p) {
    return p->validity == VALIDITY_OK ? "OK" : "MISSING";
}

static size_t put_transform(struct igtl_client *c, const struct igtl_pose *p, uint8_t *out) {
    struct igtl_metadata status = {"TransformStatus", status_of(p)};
    struct igtl_head head = head_of(c, "TRANSFORM", p->name, p->utc_ns);
    head.metadata_count = 1;
    head.metadata = &status;
    CHECK(out + igtl_message_size(&head, IGTL_TRANSFORM_SIZE) <= c->bytes + sizeof c->bytes);
    igtl_write_transform(p->T_world_body, out + igtl_message_content(c->version));
    return igtl_message_finish(&head, IGTL_TRANSFORM_SIZE, out);
}

static bool is_chosen(const struct igtl_pose *p, const char *name) {
    return p->validity != VALIDITY_LOST && (!name[0] || !strcmp(p->name, name));
}

static size_t write_transforms(struct igtl_client *c, const struct igtl_poses *set,
                               const char *name) {
    size_t size = 0;
    for (int i = 0; i < set->count; i++)
        if (is_chosen(&set->poses[i], name))
            size += put_transform(c, &set->poses[i], c->bytes + size);
    return size;
}

// A TDATA or QTDATA of all poses.
static size_t write_tools(struct igtl_client *c, const struct igtl_poses *set,
                          enum igtl_type type) {
    char keys[IGTL_POSES_MAX][IGTL_DEVICE_SIZE + 6];
    struct igtl_metadata metadata[IGTL_POSES_MAX];
    struct igtl_head head = head_of(c, igtl_type_name(type), c->served->device, set->utc_ns);
    size_t size = 0;
    head.metadata = metadata;
    for (int i = 0; i < set->count; i++) {
        const struct igtl_pose *p = &set->poses[i];
        if (!is_chosen(p, ""))
            continue;
        size += type == IGTL_TYPE_TDATA
                    ? igtl_write_tdata(p->name, p->T_world_body, content(c) + size)
                    : igtl_write_qtdata(p->name, p->T_world_body, content(c) + size);
        char *key = keys[head.metadata_count];
        snprintf(key, sizeof keys[0], "%sStatus", p->name);
        metadata[head.metadata_count++] = (struct igtl_metadata){key, status_of(p)};
    }
    CHECK(igtl_message_size(&head, size) <= sizeof c->bytes);
    return size ? igtl_message_finish(&head, size, c->bytes) : 0;
}

static size_t write_set(struct igtl_client *c, const struct igtl_poses *set, enum igtl_type type,
                        const char *name) {
    return type == IGTL_TYPE_TRANSFORM ? write_transforms(c, set, name) : write_tools(c, set, type);
}

static size_t write_state(struct igtl_client *c) {
    const struct igtl_state *s = &c->served->state;
    struct igtl_head head = head_of(c, "STATUS", c->served->device, s->utc_ns);
    size_t size = igtl_write_status(c->served->state_count ? s->code : STATUS_OK, s->subcode,
                                    s->name, s->text, content(c));
    return igtl_message_finish(&head, size, c->bytes);
}

static size_t write_string(struct igtl_client *c, const struct served_string *s) {
    struct igtl_head head = head_of(c, "STRING", s->device, s->utc_ns);
    return igtl_message_finish(&head, igtl_write_string(s->text, content(c)), c->bytes);
}

static size_t write_capabilities(struct igtl_client *c) {
    int count = sizeof capabilities / sizeof *capabilities;
    struct igtl_head head = head_of(c, "CAPABILITY", c->served->device, 0);
    size_t size = igtl_write_capability(capabilities, count, content(c));
    return igtl_message_finish(&head, size, c->bytes);
}

static size_t write_ready(struct igtl_client *c, enum igtl_type type, bool failed) {
    char name[IGTL_TYPE_SIZE];
    snprintf(name, sizeof name, "RTS_%.8s", igtl_type_name(type));
    struct igtl_head head = head_of(c, name, c->served->device, 0);
    *content(c) = failed;
    return igtl_message_finish(&head, 1, c->bytes);
}

static size_t write_not_found(struct igtl_client *c, const struct igtl_query *query) {
    struct igtl_head head = head_of(c, "STATUS", query->device, 0);
    size_t size = igtl_write_status(STATUS_NOT_FOUND, 0, igtl_type_name(query->type),
                                    "there is none of that name", content(c));
    return igtl_message_finish(&head, size, c->bytes);
}

// ---- answers ------------------------------------------------------------------------------------

// They are sent again in their turn.
static size_t answer_meshes(struct igtl_client *c, const struct igtl_query *query) {
    bool found = false;
    for (int i = 0; i < IGTL_MESHES_MAX; i++) {
        const char *name = c->served->meshes[i].name;
        if (!name[0] || (query->device[0] && strcmp(name, query->device) != 0))
            continue;
        found = true;
        c->meshes[i] = 0;
    }
    return found ? 0 : write_ready(c, IGTL_TYPE_POLYDATA, true);
}

static size_t answer_poses(struct igtl_client *c, const struct igtl_query *query) {
    const char *name = query->type == IGTL_TYPE_TRANSFORM ? query->device : "";
    size_t size = 0;
    if (c->served->set_count)
        size = write_set(c, &served_get_set(c->served, c->served->set_count)->poses, query->type,
                         name);
    return size ? size : write_not_found(c, query);
}

static size_t answer(struct igtl_client *c, const struct pending *pending) {
    const struct igtl_query *query = &pending->query;
    if (query->kind != IGTL_QUERY_GET)
        return write_ready(c, query->type, pending->failed);
    switch (query->type) {
    case IGTL_TYPE_STATUS:
        return write_state(c);
    case IGTL_TYPE_CAPABILITY:
        return write_capabilities(c);
    case IGTL_TYPE_POLYDATA:
        return answer_meshes(c, query);
    case IGTL_TYPE_POSITION:
        return write_not_found(c, query);
    default:
        return answer_poses(c, query);
    }
}

static size_t next_answer(struct igtl_client *c) {
    size_t size = 0;
    int i = 0;
    while (i < c->query_count && !size)
        size = answer(c, &c->queries[i++]);
    c->query_count -= i;
    memmove(c->queries, c->queries + i, (size_t)c->query_count * sizeof *c->queries);
    return size;
}

// ---- what comes by itself -----------------------------------------------------------------------

static size_t next_state(struct igtl_client *c) {
    if (c->states == c->served->state_count)
        return 0;
    c->states = c->served->state_count;
    return write_state(c);
}

static size_t next_string(struct igtl_client *c) {
    if (c->strings == c->served->string_count || igtl_client_is_full(c))
        return 0;
    return write_string(c, served_get_string(c->served, ++c->strings));
}

static void skip_old_sets(struct igtl_client *c, int64_t now_ns) {
    uint64_t newest = c->served->set_count;
    bool gone = newest - c->sets > SERVED_SETS;
    if (gone || (c->choked && newest > c->sets &&
                 served_get_set(c->served, c->sets + 1)->put_ns < now_ns - stale_ns))
        c->sets = newest - 1;
}

// A quarter of the interval is forgiven, so that a rate which only jitters loses nothing.
static bool is_due(struct igtl_client *c, int64_t put_ns) {
    if (put_ns < c->due_ns - c->interval_ns / 4)
        return false;
    bool late = put_ns - c->due_ns > c->interval_ns;
    c->due_ns = (late ? put_ns : c->due_ns) + c->interval_ns;
    return true;
}

static size_t next_set(struct igtl_client *c, int64_t now_ns) {
    size_t size = 0;
    skip_old_sets(c, now_ns);
    while (c->sets < c->served->set_count && !size) {
        const struct served_set *set = served_get_set(c->served, ++c->sets);
        if (is_due(c, set->put_ns))
            size = write_set(c, &set->poses, c->wanted, "");
    }
    return size;
}

static size_t give_mesh(struct igtl_client *c, const uint8_t **out) {
    size_t left = c->sending->size - c->sent;
    size_t size = left < IGTL_CLIENT_BYTES_MAX ? left : IGTL_CLIENT_BYTES_MAX;
    *out = c->sending->bytes + c->sent;
    c->sent += size;
    return size;
}

static bool next_mesh(struct igtl_client *c) {
    for (int i = 0; i < IGTL_MESHES_MAX; i++) {
        struct served_mesh *mesh = &c->served->meshes[i];
        if (!mesh->name[0] || c->meshes[i] == mesh->count)
            continue;
        c->meshes[i] = mesh->count;
        c->sending = served_use_mesh(mesh, c->version);
        c->sent = 0;
        return true;
    }
    return false;
}

size_t igtl_client_next(struct igtl_client *c, int64_t now_ns, const uint8_t **out) {
    if (c->sending && c->sent < c->sending->size)
        return give_mesh(c, out);
    served_bytes_release(&c->sending);
    *out = c->bytes;
    size_t size = next_answer(c);
    if (!size)
        size = next_state(c);
    if (!size)
        size = next_string(c);
    if (!size && c->mesh_before_set && next_mesh(c)) {
        c->mesh_before_set = false;
        return give_mesh(c, out);
    }
    if (!size) {
        size = next_set(c, now_ns);
        c->mesh_before_set = true;
    }
    if (!size && next_mesh(c))
        return give_mesh(c, out);
    c->choked &= size > 0;
    return size;
}

bool igtl_client_waits(const struct igtl_client *c) {
    const struct served *s = c->served;
    bool waits = c->query_count || (c->sending && c->sent < c->sending->size) ||
                 c->states != s->state_count || c->strings != s->string_count ||
                 c->sets != s->set_count;
    for (int i = 0; i < IGTL_MESHES_MAX; i++)
        waits |= s->meshes[i].name[0] && c->meshes[i] != s->meshes[i].count;
    return waits;
}

void igtl_client_choked(struct igtl_client *c) {
    c->choked = true;
}

bool igtl_client_is_full(const struct igtl_client *c) {
    return c->served->string_count - c->strings >= IGTL_STRINGS_MAX;
}
