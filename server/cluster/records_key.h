// The key "records" of the bucket, as JSON.
#pragma once

#include "base/result.h"
#include "store/share.h"

#define RECORDS_KEY "records"
#define RECORDS_KEY_SIZE 16384

struct records_key {
    char order[STORE_ID_MAX];
    int server_count;
    struct records_member {
        char name[STORE_NAME_MAX], file[STORE_ID_MAX]; // file: store/share.h
    } servers[STORE_SERVERS_MAX];                      // by their slots
    // The copy of all records; size 0: there is none yet.
    uint64_t place;        // up to which it has the changes
    uint64_t token, first; // of its messages; the sequence of the first
    uint64_t size, hash;   // in bytes; its XXH3
};

// A new order, without servers.
void records_key_begin(struct records_key *out);
// A new name, for an order or a file.
void records_key_name(char out_name[STORE_ID_MAX]);
// The slot of a file, which is added if it is not there. -1: there are as many as may be.
int records_key_slot(struct records_key *key, const char *server, const char *file);

void records_key_text(const struct records_key *key, char out_text[RECORDS_KEY_SIZE]);
// RESULT_FORMAT: it is none.
enum result records_key_read(const char *text, struct records_key *out, struct error *err);
