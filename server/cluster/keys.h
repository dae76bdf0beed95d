// The keys of the lease as text: names of the bucket's keys, and their values as JSON.
#pragma once

#include "cluster/jet.h"

#define KEY_SIZE (JET_TOKEN_SIZE + 16)
#define KEY_VALUE_SIZE 1024

// server.NAME or station.NAME, the name as a token.
void key_name(bool is_server, const char *name, char out_key[KEY_SIZE]);
// False: it is neither.
bool key_parse(const char *key, bool *out_is_server, char out_name[SERVER_NAME_SIZE]);

void key_server_text(const struct server_value *value, char out_text[KEY_VALUE_SIZE]);
void key_station_text(const struct station_value *value, char out_text[KEY_VALUE_SIZE]);
// False: it is none.
bool key_server_value(const char *text, size_t size, struct server_value *out_value);
bool key_station_value(const char *text, size_t size, struct station_value *out_value);
