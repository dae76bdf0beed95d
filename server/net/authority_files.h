// The files of the authority: replaced atomically as a whole, mode 0600. Records are lines of text,
// "key utc_seconds station".
#pragma once

#include "base/result.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define RECORD_KEY_MAX 65
#define RECORD_STATION_MAX 64

// A one-time code (key: hash of its secret, time: when it ends), a certificate issued (key: its
// serial number) or one revoked.
struct record {
    char key[RECORD_KEY_MAX];
    int64_t utc_s;
    char station[RECORD_STATION_MAX];
};

struct records {
    struct record *items;
    int count;
};

// Takes the folder's lock, which keeps out other processes and threads; close the descriptor to
// release it. If another one holds the lock, waits, or without `waits` returns RESULT_TIMEOUT.
enum result authority_lock(const char *dir, bool waits, int *out_fd, struct error *err);

// Writes a new file, syncs and renames it: a reader finds the old file or the new one.
enum result authority_write(const char *dir, const char *name, const void *data, size_t size,
                            struct error *err);

// A missing file has no records. RESULT_CORRUPT: a line is no record. Release with records_release,
// after an error too.
enum result records_read(const char *dir, const char *name, struct records *out_records,
                         struct error *err);
enum result records_write(const char *dir, const char *name, const struct records *records,
                          struct error *err);
void records_release(struct records *records);

void records_add(struct records *records, const char *key, int64_t utc_s, const char *station);
void records_remove(struct records *records, int index);
