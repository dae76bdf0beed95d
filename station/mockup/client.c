#include "client.h"

#include "base/clock.h"
#include "igtl/query.h"

#include <errno.h>
#include <sys/socket.h>

bool client_send(const struct client *client, const uint8_t *bytes, size_t size) {
    return send(client->fd, bytes, size, MSG_NOSIGNAL) == (ssize_t)size;
}

static bool send_answer(const struct client *client, const char *type, const void *content,
                        size_t size) {
    uint8_t bytes[ENCODE_ANSWER_MAX];
    return client_send(client, bytes, encode_answer(type, client->version, content, size, bytes));
}

static bool offers_streams(const struct client *client) {
    return client->offers == MESSAGE_TDATA || client->offers == MESSAGE_QTDATA;
}

static bool take_start(struct client *client, const struct igtl_query *query, bool good) {
    bool quaternions = query->type == IGTL_TYPE_QTDATA;
    uint8_t refused = !good || !offers_streams(client);
    if (!refused) {
        client->interval_ns = query->interval_ms * NS_PER_MS;
        client->type = quaternions ? MESSAGE_QTDATA : MESSAGE_TDATA;
        client->asked = true;
        client->once = false;
    }
    return send_answer(client, quaternions ? "RTS_QTDATA" : "RTS_TDATA", &refused, 1);
}

// A request for a type that is not offered is passed over.
static void take_get(struct client *client, enum message_type type) {
    if (client->offers != type)
        return;
    client->type = type;
    client->asked = client->once = true;
}

static bool take_query(struct client *client, const struct igtl_query *query, bool good) {
    static const uint8_t all_is_well[31] = {0, 1};
    if (query->kind == IGTL_QUERY_START)
        return take_start(client, query, good);
    if (query->kind == IGTL_QUERY_STOP)
        client->asked = false;
    if (query->kind != IGTL_QUERY_GET)
        return true;
    if (query->type == IGTL_TYPE_TRANSFORM)
        take_get(client, MESSAGE_TRANSFORM);
    if (query->type == IGTL_TYPE_POSITION)
        take_get(client, MESSAGE_POSITION);
    return query->type != IGTL_TYPE_STATUS ||
           send_answer(client, "STATUS", all_is_well, sizeof all_is_well);
}

static bool take_frame(struct client *client, const struct igtl_frame *frame) {
    struct igtl_query query;
    enum result result = igtl_query_read(frame, &query, NULL);
    return result != RESULT_CORRUPT && take_query(client, &query, result == RESULT_OK);
}

static bool take_bytes(struct client *client, const uint8_t *bytes, size_t size) {
    while (size) {
        enum igtl_framing_event event;
        struct igtl_frame frame;
        size_t taken = igtl_framing_feed(&client->framing, bytes, size, &event, &frame, NULL);
        if (event == IGTL_FRAMING_BROKEN)
            return false;
        if (event == IGTL_FRAMING_MESSAGE && !take_frame(client, &frame))
            return false;
        bytes += taken;
        size -= taken;
    }
    return true;
}

bool client_read(struct client *client) {
    uint8_t bytes[1024];
    ssize_t size = recv(client->fd, bytes, sizeof bytes, 0);
    if (size < 0)
        return errno == EAGAIN || errno == EINTR;
    return size > 0 && take_bytes(client, bytes, (size_t)size);
}
