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

static bool answer(const struct client *client, const char *type, bool granted) {
    uint8_t bytes[IGTL_HEADER_SIZE + 1], status = !granted;
    igtl_header header = {.version = 1, .body_size = sizeof status};
    memcpy(header.name, type, strlen(type));
    memcpy(header.device_name, "Tracker", strlen("Tracker"));
    header.crc = crc64(&status, sizeof status, 0);
    igtl_header_convert_byte_order(&header);
    memcpy(bytes, &header, sizeof header);
    bytes[IGTL_HEADER_SIZE] = status;
    return client_send(client, bytes, sizeof bytes);
}

// STT_TDATA and STT_QTDATA have the same body.
static bool take_start(struct client *client, const igtl_header *header, const uint8_t *body) {
    bool quaternions = !strcmp(header->name, "STT_QTDATA");
    igtl_stt_tdata start;
    bool good = header->body_size == sizeof start &&
                crc64((unsigned char *)body, (int)header->body_size, 0) == header->crc;
    if (good) {
        memcpy(&start, body, sizeof start);
        igtl_stt_tdata_convert_byte_order(&start);
        client->interval_ns = start.resolution * NS_PER_MS;
        client->type = quaternions ? MESSAGE_QTDATA : MESSAGE_TDATA;
        client->asked = true;
    }
    return answer(client, quaternions ? "RTS_QTDATA" : "RTS_TDATA", good);
}

static bool take_message(struct client *client, const igtl_header *header, const uint8_t *body) {
    if (!strncmp(header->name, "STT_TDATA", sizeof header->name) ||
        !strncmp(header->name, "STT_QTDATA", sizeof header->name))
        return take_start(client, header, body);
    if (!strncmp(header->name, "STP_", 4))
        client->asked = false;
    return true;
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
    return take_message(client, &header, client->bytes + sizeof header) ? size : -1;
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
