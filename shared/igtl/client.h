// One client of a server: what it asked for, and what it gets next. Bytes in, bytes out: no
// sockets, no clock. The server's thread.
#pragma once

#include "igtl/query.h"
#include "igtl/served.h"

#define IGTL_CLIENT_BYTES_MAX 16384
#define IGTL_CLIENT_QUERIES_MAX 128 // that wait for their answers

struct igtl_client;

// It gets status, poses and meshes as they are, and then what comes. `served` stays
// the caller's; `number` is for log lines.
struct igtl_client *igtl_client_create(struct served *served, int number);
void igtl_client_destroy(struct igtl_client **client);

// It sent these bytes. RESULT_LIMIT: more requests than it takes answers to, or a message of an
// absurd length. It has to be dropped then.
enum result igtl_client_hear(struct igtl_client *client, const uint8_t *bytes, size_t size,
                             struct error *err);

// The bytes to send next, good until the next call; 0: nothing waits.
size_t igtl_client_next(struct igtl_client *client, int64_t now_ns, const uint8_t **out_bytes);

// Something waits, or may: the caller asks for it.
bool igtl_client_waits(const struct igtl_client *client);

// The connection takes no more for now: what is old by then is skipped.
void igtl_client_choked(struct igtl_client *client);

// It let so many strings wait that it has to be dropped.
bool igtl_client_is_full(const struct igtl_client *client);
