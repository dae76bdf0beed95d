#include "live/passing.h"

#include <string.h>

enum { WIRE_VARINT = 0, WIRE_BYTES = 2 };

#define BATCH_ITEMS 1
#define PLACE_INFO 2
#define PLACE_NUMBER 1
#define INFO_STATION 2
#define INFO_SERVER 31
#define SESSION_STATION 3
#define ATTEMPT_NUMBER 18
#define REPLY_SESSIONS 3
#define TROUBLE_WHY 3
#define WHY_CODE 1
#define NAME_MAX_SIZE 128

struct wire_field {
    uint32_t tag;
    int type;
    const uint8_t *whole; // with its key
    size_t whole_size;
    const uint8_t *data; // of WIRE_BYTES
    size_t size;
    uint64_t value; // of WIRE_VARINT
};

// ---- reading ------------------------------------------------------------------------------------

static bool read_varint(const uint8_t *bytes, size_t size, size_t *at, uint64_t *out) {
    *out = 0;
    for (int shift = 0; shift < 64 && *at < size; shift += 7) {
        uint8_t byte = bytes[(*at)++];
        *out |= (uint64_t)(byte & 127) << shift;
        if (byte < 128)
            return true;
    }
    return false;
}

// False at the end, where *at is size, and where it is no message.
static bool next_field(const uint8_t *bytes, size_t size, size_t *at, struct wire_field *out) {
    uint64_t key, length = 0;
    size_t begin = *at;
    if (*at >= size || !read_varint(bytes, size, at, &key))
        return false;
    *out =
        (struct wire_field){.tag = (uint32_t)(key >> 3), .type = (int)(key & 7), .whole = bytes + begin};
    if (out->type == WIRE_VARINT) {
        if (!read_varint(bytes, size, at, &out->value))
            return false;
    } else if (out->type == WIRE_BYTES) {
        if (!read_varint(bytes, size, at, &length))
            return false;
    } else {
        length = out->type == 1 ? 8 : out->type == 5 ? 4 : SIZE_MAX;
    }
    if (length > size - *at)
        return false;
    out->data = bytes + *at;
    out->size = (size_t)length;
    *at += (size_t)length;
    out->whole_size = *at - begin;
    return true;
}

// The last of that tag, as protobuf has it.
static bool find(const uint8_t *bytes, size_t size, uint32_t tag, struct wire_field *out) {
    struct wire_field field;
    bool found = false;
    for (size_t at = 0; next_field(bytes, size, &at, &field);)
        if (field.tag == tag) {
            *out = field;
            found = true;
        }
    return found;
}

static uint64_t number_in(const struct wire_field *message, uint32_t tag) {
    struct wire_field field;
    bool found = find(message->data, message->size, tag, &field) && field.type == WIRE_VARINT;
    return found ? field.value : 0;
}

static void text_in(const struct wire_field *message, uint32_t tag, char out[NAME_MAX_SIZE]) {
    struct wire_field field;
    out[0] = '\0';
    if (!find(message->data, message->size, tag, &field) || field.type != WIRE_BYTES ||
        field.size >= NAME_MAX_SIZE)
        return;
    memcpy(out, field.data, field.size);
    out[field.size] = '\0';
}

// ---- writing ------------------------------------------------------------------------------------

static size_t varint_size(uint64_t value) {
    size_t size = 1;
    for (; value >= 128; value >>= 7)
        size++;
    return size;
}

static uint8_t *put_varint(uint8_t *out, uint64_t value) {
    for (; value >= 128; value >>= 7)
        *out++ = (uint8_t)(value | 128);
    *out++ = (uint8_t)value;
    return out;
}

static uint8_t *put_bytes(uint8_t *out, const uint8_t *bytes, size_t size) {
    memcpy(out, bytes, size);
    return out + size;
}

static uint8_t *put_head(uint8_t *out, uint32_t tag, size_t size) {
    return put_varint(put_varint(out, (uint64_t)tag << 3 | WIRE_BYTES), size);
}

// ---- one item -----------------------------------------------------------------------------------

// Of an item that is about a station the tag of its number; 0: it has none.
static uint32_t number_tag(uint32_t kind) {
    switch (kind) {
    case arthron_Live_place_tag:
    case arthron_Live_session_tag:
    case arthron_Live_moment_tag:
        return PLACE_NUMBER;
    case arthron_Live_attempt_tag:
        return ATTEMPT_NUMBER;
    default:
        return 0;
    }
}

_Static_assert((int)arthron_Live_resection_tag == PASSING_CHUNK - 1 &&
                   (int)arthron_Live_remark_tag == PASSING_CHUNK + 1,
               "the chunk is where the schema has it");
_Static_assert(PLACE_NUMBER == arthron_Place_station_number_tag &&
                   PLACE_NUMBER == arthron_LiveSession_station_number_tag &&
                   PLACE_NUMBER == arthron_Moment_station_number_tag &&
                   ATTEMPT_NUMBER == arthron_AttemptState_station_number_tag &&
                   PLACE_INFO == arthron_Place_info_tag &&
                   INFO_STATION == arthron_SessionInfo_station_tag &&
                   INFO_SERVER == arthron_SessionInfo_server_tag &&
                   SESSION_STATION == arthron_LiveSession_station_tag &&
                   REPLY_SESSIONS == arthron_CommandReply_sessions_tag &&
                   TROUBLE_WHY == arthron_Trouble_why_tag && WHY_CODE == arthron_Why_code_tag,
               "the numbers are those of the schema");

static void learn(struct passing *p, uint64_t number, const char *station) {
    if (number < (uint64_t)p->numbers->count && station[0])
        p->numbers->own[number] = p->find(p->user, station, p->numbers->own[number]);
}

static int own_number(struct passing *p, const struct wire_field *message, uint32_t tag) {
    char station[NAME_MAX_SIZE];
    struct wire_field info;
    uint64_t number = number_in(message, tag);
    if (message->tag == arthron_Live_session_tag) {
        text_in(message, SESSION_STATION, station);
        learn(p, number, station);
    } else if (message->tag == arthron_Live_place_tag &&
               find(message->data, message->size, PLACE_INFO, &info)) {
        text_in(&info, INFO_STATION, station);
        learn(p, number, station);
    }
    return number < (uint64_t)p->numbers->count ? p->numbers->own[number] : -1;
}

static uint8_t *put_numbered(uint8_t *out, const struct wire_field *message, uint32_t tag, int number) {
    struct wire_field field;
    size_t size = varint_size((uint64_t)tag << 3) + varint_size((uint64_t)number);
    for (size_t at = 0; next_field(message->data, message->size, &at, &field);)
        size += field.tag == tag ? 0 : field.whole_size;
    out = put_head(out, BATCH_ITEMS,
                   varint_size((uint64_t)message->tag << 3) + varint_size(size) + size);
    out = put_head(out, message->tag, size);
    out = put_varint(put_varint(out, (uint64_t)tag << 3), (uint64_t)number);
    for (size_t at = 0; next_field(message->data, message->size, &at, &field);)
        if (field.tag != tag)
            out = put_bytes(out, field.whole, field.whole_size);
    return out;
}

static uint8_t *take_item(struct passing *p, const struct wire_field *item, const struct wire_field *message,
                          uint8_t *out) {
    uint32_t tag = number_tag(message->tag);
    int station = tag ? own_number(p, message, tag) : -1;
    struct wire_field why;
    if (message->tag == arthron_Live_command_reply_tag) {
        p->reply(p->user, item->whole, item->whole_size);
        return out;
    }
    if (message->tag == arthron_Live_trouble_tag)
        p->why = find(message->data, message->size, TROUBLE_WHY, &why)
                     ? (arthron_Why_Code)number_in(&why, WHY_CODE)
                     : arthron_Why_Code_UNSAID;
    if (!p->wanted(p->user, message->tag, station))
        return out;
    return tag ? put_numbered(out, message, tag, station < 0 ? 0 : station)
               : put_bytes(out, item->whole, item->whole_size);
}

bool passing_take(struct passing *p, const uint8_t *batch, size_t size, uint8_t *out,
                  size_t *out_size) {
    struct wire_field item, message;
    uint8_t *to = out;
    size_t at = 0;
    while (next_field(batch, size, &at, &item)) {
        size_t inside = 0;
        if (item.tag == BATCH_ITEMS && item.type == WIRE_BYTES &&
            next_field(item.data, item.size, &inside, &message) && message.type == WIRE_BYTES &&
            inside == item.size)
            to = take_item(p, &item, &message, to);
    }
    *out_size = (size_t)(to - out);
    return at == size;
}

size_t passing_first(const uint8_t *items, size_t size, uint32_t *out_kind) {
    struct wire_field item, message;
    size_t at = 0, inside = 0;
    *out_kind = 0;
    if (!next_field(items, size, &at, &item))
        return 0;
    if (next_field(item.data, item.size, &inside, &message))
        *out_kind = message.tag;
    return at;
}

// ---- lists --------------------------------------------------------------------------------------

static bool reply_in(const uint8_t *bytes, size_t size, struct wire_field *out) {
    struct wire_field item;
    size_t at = 0, inside = 0;
    return next_field(bytes, size, &at, &item) && next_field(item.data, item.size, &inside, out) &&
           out->tag == arthron_Live_command_reply_tag && out->type == WIRE_BYTES;
}

// The row of a station that the other server serves itself.
static bool row_of(const struct wire_field *reply, const char *station, struct wire_field *out) {
    char name[NAME_MAX_SIZE], server[NAME_MAX_SIZE];
    for (size_t at = 0; next_field(reply->data, reply->size, &at, out);) {
        if (out->tag != REPLY_SESSIONS || out->type != WIRE_BYTES)
            continue;
        text_in(out, INFO_STATION, name);
        text_in(out, INFO_SERVER, server);
        if (!strcmp(name, station) && !server[0])
            return true;
    }
    return false;
}

// What a row tells of the server stays that of the own one, which knows the other's address.
static bool replaced(const struct wire_field *row, const struct wire_field *other, struct wire_field *out_row,
                     char out_server[NAME_MAX_SIZE]) {
    char station[NAME_MAX_SIZE];
    if (row->tag != REPLY_SESSIONS || row->type != WIRE_BYTES)
        return false;
    text_in(row, INFO_SERVER, out_server);
    text_in(row, INFO_STATION, station);
    return out_server[0] && row_of(other, station, out_row);
}

static size_t server_size(const char *server) {
    return 2 + varint_size(strlen(server)) + strlen(server);
}

static size_t merged_size(const struct wire_field *own, const struct wire_field *other) {
    struct wire_field field, row;
    char server[NAME_MAX_SIZE];
    size_t size = 0;
    for (size_t at = 0; next_field(own->data, own->size, &at, &field);) {
        size_t inner = 0;
        if (!replaced(&field, other, &row, server)) {
            size += field.whole_size;
            continue;
        }
        inner = row.size + server_size(server);
        size += 1 + varint_size(inner) + inner;
    }
    return size;
}

size_t passing_merge(const uint8_t *own, size_t own_size, const uint8_t *other, size_t other_size,
                     uint8_t *out, size_t room) {
    struct wire_field mine, theirs, field, row;
    char server[NAME_MAX_SIZE];
    if (!reply_in(own, own_size, &mine) || !reply_in(other, other_size, &theirs))
        return 0;
    size_t size = merged_size(&mine, &theirs), inner = 1 + varint_size(size) + size;
    if (1 + varint_size(inner) + inner > room)
        return 0;
    uint8_t *to = put_head(out, BATCH_ITEMS, inner);
    to = put_head(to, arthron_Live_command_reply_tag, size);
    for (size_t at = 0; next_field(mine.data, mine.size, &at, &field);) {
        if (!replaced(&field, &theirs, &row, server)) {
            to = put_bytes(to, field.whole, field.whole_size);
            continue;
        }
        to = put_head(to, REPLY_SESSIONS, row.size + server_size(server));
        to = put_bytes(to, row.data, row.size);
        to = put_head(to, INFO_SERVER, strlen(server));
        to = put_bytes(to, (const uint8_t *)server, strlen(server));
    }
    return (size_t)(to - out);
}
