#include "cluster/records_key.h"

#include "base/chance.h"
#include "base/check.h"

#include <inttypes.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void records_key_name(char out[STORE_ID_MAX]) {
    uint64_t chance[2];
    chance_fill(chance, sizeof chance);
    snprintf(out, STORE_ID_MAX, "%016" PRIx64 "%016" PRIx64, chance[0], chance[1]);
}

void records_key_begin(struct records_key *out) {
    *out = (struct records_key){0};
    records_key_name(out->order);
}

int records_key_slot(struct records_key *key, const char *server, const char *file) {
    for (int i = 0; i < key->server_count; i++)
        if (!strcmp(key->servers[i].file, file))
            return i;
    if (key->server_count == STORE_SERVERS_MAX)
        return -1;
    struct records_member *member = &key->servers[key->server_count];
    snprintf(member->name, sizeof member->name, "%s", server);
    snprintf(member->file, sizeof member->file, "%s", file);
    return key->server_count++;
}

// Numbers of 64 bits are texts: those of JSON have 63.
static void put(json_t *object, const char *name, uint64_t number) {
    char text[24];
    snprintf(text, sizeof text, "%016" PRIx64, number);
    json_object_set_new(object, name, json_string(text));
}

static json_t *key_text(const char *text) {
    json_t *value = json_string(text);
    return value ? value : json_string(""); // it is no UTF-8
}

void records_key_text(const struct records_key *key, char out[RECORDS_KEY_SIZE]) {
    json_t *object = json_object(), *servers = json_array(), *copy = json_object();
    for (int i = 0; i < key->server_count; i++)
        json_array_append_new(servers,
                              json_pack("{s:o, s:o}", "name", key_text(key->servers[i].name),
                                        "file", key_text(key->servers[i].file)));
    put(copy, "place", key->place);
    put(copy, "token", key->token);
    put(copy, "first", key->first);
    put(copy, "size", key->size);
    put(copy, "hash", key->hash);
    json_object_set_new(object, "order", json_string(key->order));
    json_object_set_new(object, "servers", servers);
    json_object_set_new(object, "copy", copy);
    char *printed = json_dumps(object, JSON_COMPACT);
    NEED(printed, "memory");
    int length = snprintf(out, RECORDS_KEY_SIZE, "%s", printed);
    CHECK(length < RECORDS_KEY_SIZE);
    free(printed);
    json_decref(object);
}

static bool take_number(const json_t *object, const char *name, uint64_t *out) {
    const char *text = json_string_value(json_object_get(object, name));
    char *end = NULL;
    *out = text ? strtoull(text, &end, 16) : 0;
    return text && strlen(text) == 16 && !*end;
}

static bool take_text(const json_t *value, char *out, size_t size) {
    const char *text = json_string_value(value);
    return text && *text && snprintf(out, size, "%s", text) < (int)size;
}

static bool take_servers(const json_t *servers, struct records_key *out) {
    size_t count = json_array_size(servers);
    if (!count || count > STORE_SERVERS_MAX)
        return false;
    for (size_t i = 0; i < count; i++) {
        const json_t *server = json_array_get(servers, i);
        struct records_member *member = &out->servers[i];
        if (!take_text(json_object_get(server, "name"), member->name, sizeof member->name) ||
            !take_text(json_object_get(server, "file"), member->file, sizeof member->file))
            return false;
    }
    out->server_count = (int)count;
    return true;
}

enum result records_key_read(const char *text, struct records_key *out, struct error *err) {
    json_t *object = json_loads(text, 0, NULL);
    const json_t *copy = json_object_get(object, "copy");
    *out = (struct records_key){0};
    bool good = take_text(json_object_get(object, "order"), out->order, sizeof out->order) &&
                take_servers(json_object_get(object, "servers"), out) &&
                take_number(copy, "place", &out->place) &&
                take_number(copy, "token", &out->token) &&
                take_number(copy, "first", &out->first) && take_number(copy, "size", &out->size) &&
                take_number(copy, "hash", &out->hash);
    json_decref(object);
    return good ? RESULT_OK
                : fail(err, RESULT_FORMAT, "NATS: the key " RECORDS_KEY " is not one of servers");
}
