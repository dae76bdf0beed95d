#include "cluster/keys.h"

#include "base/check.h"

#include <inttypes.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char server_prefix[] = "server.", station_prefix[] = "station.";

void key_name(bool is_server, const char *name, char out[KEY_SIZE]) {
    char token[JET_TOKEN_SIZE];
    jet_token(name, token);
    snprintf(out, KEY_SIZE, "%s%s", is_server ? server_prefix : station_prefix, token);
}

bool key_parse(const char *key, bool *out_is_server, char out_name[SERVER_NAME_SIZE]) {
    *out_is_server = !strncmp(key, server_prefix, sizeof server_prefix - 1);
    if (!*out_is_server && strncmp(key, station_prefix, sizeof station_prefix - 1) != 0)
        return false;
    return jet_name(strchr(key, '.') + 1, out_name);
}

// ---- values -------------------------------------------------------------------------------------

// A life has 64 bits, and numbers of JSON are of 63: as text.
static void print(json_t *object, uint64_t life, uint64_t write, char out[KEY_VALUE_SIZE]) {
    char text[24];
    snprintf(text, sizeof text, "%016" PRIx64, life);
    json_object_set_new(object, "life", json_string(text));
    json_object_set_new(object, "write", json_integer((json_int_t)write));
    char *printed = json_dumps(object, JSON_COMPACT);
    NEED(printed, "memory");
    int length = snprintf(out, KEY_VALUE_SIZE, "%s", printed);
    CHECK(length < KEY_VALUE_SIZE);
    free(printed);
    json_decref(object);
}

static json_t *text_of(const char *value) {
    json_t *text = json_string(value);
    return text ? text : json_string(""); // it is no UTF-8
}

void key_server_text(const struct server_value *value, char out[KEY_VALUE_SIZE]) {
    json_t *object = json_object();
    json_object_set_new(object, "stations", text_of(value->stations));
    json_object_set_new(object, "pages", text_of(value->pages));
    json_object_set_new(object, "secret", text_of(value->secret));
    print(object, value->life, value->write, out);
}

void key_station_text(const struct station_value *value, char out[KEY_VALUE_SIZE]) {
    json_t *object = json_object();
    json_object_set_new(object, "server", text_of(value->server));
    print(object, value->life, value->write, out);
}

static bool copy(const json_t *object, const char *name, char *out, size_t size) {
    const char *text = json_string_value(json_object_get(object, name));
    return text && (size_t)snprintf(out, size, "%s", text) < size;
}

static bool numbers(const json_t *object, uint64_t *out_life, uint64_t *out_write) {
    char life[24], *end;
    const json_t *write = json_object_get(object, "write");
    if (!copy(object, "life", life, sizeof life) || !json_is_integer(write))
        return false;
    *out_life = strtoull(life, &end, 16);
    *out_write = (uint64_t)json_integer_value(write);
    return end != life && !*end;
}

bool key_server_value(const char *text, size_t size, struct server_value *out) {
    json_t *object = json_loadb(text, size, 0, NULL);
    bool is_one = numbers(object, &out->life, &out->write) &&
                  copy(object, "stations", out->stations, sizeof out->stations) &&
                  copy(object, "pages", out->pages, sizeof out->pages);
    if (!copy(object, "secret", out->secret, sizeof out->secret))
        out->secret[0] = '\0'; // of an earlier program
    json_decref(object);
    return is_one;
}

bool key_station_value(const char *text, size_t size, struct station_value *out) {
    json_t *object = json_loadb(text, size, 0, NULL);
    bool is_one = numbers(object, &out->life, &out->write) &&
                  copy(object, "server", out->server, sizeof out->server);
    json_decref(object);
    return is_one;
}
