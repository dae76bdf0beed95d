#include "client.h"

#include "base/clock.h"

#include <errno.h>
#include <openigtlink/igtl_header.h>
#include <openigtlink/igtl_tdata.h>
#include <openigtlink/igtl_util.h>
#include <string.h>
#include <sys/socket.h>

bool client_send(const struct client *client, const uint8_t *bytes, size_t size) {
    return send(client->fd, bytes, size, MSG_NOSIGNAL) == (ssize_t)size;
}

static bool answer(const struct client *client, const char *type, const void *content,
                   size_t size) {
    uint8_t bytes[ENCODE_ANSWER_MAX];
    return client_send(client, bytes, encode_answer(type, client->version, content, size, bytes));
}

static bool offers_streams(const struct client *client) {
    return client->offers == MESSAGE_TDATA || client->offers == MESSAGE_QTDATA;
}

// STT_TDATA and STT_QTDATA have the same body.
static bool take_start(struct client *client, bool quaternions, const uint8_t *content,
                       size_t size) {
    igtl_stt_tdata start;
    bool good = size == sizeof start && offers_streams(client);
    uint8_t refused = !good;
    if (good) {
        memcpy(&start, content, sizeof start);
        igtl_stt_tdata_convert_byte_order(&start);
        client->interval_ns = start.resolution * NS_PER_MS;
        client->type = quaternions ? MESSAGE_QTDATA : MESSAGE_TDATA;
        client->asked = true;
        client->once = false;
    }
    return answer(client, quaternions ? "RTS_QTDATA" : "RTS_TDATA", &refused, 1);
}

// A request for a type that is not offered is passed over.
static void take_get(struct client *client, enum message_type type) {
    if (client->offers != type)
        return;
    client->type = type;
    client->asked = client->once = true;
}

static bool take_message(struct client *client, const char *type, const uint8_t *content,
                         size_t size) {
    static const uint8_t all_is_well[31] = {0, 1};
    if (!strcmp(type, "STT_TDATA") || !strcmp(type, "STT_QTDATA"))
        return take_start(client, !strcmp(type, "STT_QTDATA"), content, size);
    if (!strcmp(type, "GET_TRANS"))
        take_get(client, MESSAGE_TRANSFORM);
    if (!strcmp(type, "GET_POSITION"))
        take_get(client, MESSAGE_POSITION);
    if (!strcmp(type, "GET_STATUS"))
        return answer(client, "STATUS", all_is_well, sizeof all_is_well);
    if (!strncmp(type, "STP_", 4))
        client->asked = false;
    return true;
}

// From version 2 on the content lies between an extended header and metadata. False: it is none.
static bool take_body(struct client *client, const igtl_header *header, const uint8_t *body) {
    char type[IGTL_HEADER_TYPE_SIZE + 1] = "";
    size_t size = header->body_size, before = 0, behind = 0;
    memcpy(type, header->name, IGTL_HEADER_TYPE_SIZE);
    if (header->version > 1 && size >= 12) {
        before = (size_t)(body[0] << 8 | body[1]);
        behind = (size_t)(body[2] << 8 | body[3]) + (size_t)(body[6] << 8 | body[7]);
    }
    if (crc64((unsigned char *)body, (int)size, 0) != header->crc || before + behind > size)
        return false;
    return take_message(client, type, body + before, size - before - behind);
}

// The bytes of the first message, 0 while it is not complete; -1: it can never be one.
static int take_first(struct client *client) {
    igtl_header header;
    if (client->used < sizeof header)
        return 0;
    memcpy(&header, client->bytes, sizeof header);
    igtl_header_convert_byte_order(&header);
    if (header.body_size > sizeof client->bytes - sizeof header)
        return -1;
    int size = (int)(sizeof header + header.body_size);
    if (client->used < (size_t)size)
        return 0;
    return take_body(client, &header, client->bytes + sizeof header) ? size : -1;
}

bool client_read(struct client *client) {
    size_t room = sizeof client->bytes - client->used;
    ssize_t size = recv(client->fd, client->bytes + client->used, room, 0);
    if (size < 0)
        return errno == EAGAIN || errno == EINTR;
    client->used += (size_t)size;
    int taken;
    while ((taken = take_first(client)) > 0) {
        client->used -= (size_t)taken;
        memmove(client->bytes, client->bytes + taken, client->used);
    }
    return size > 0 && taken == 0;
}
