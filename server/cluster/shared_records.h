// The records that several servers share (store/share.h), through a stream of NATS: it has one
// order for the changes of all servers, and now and then a copy of all records, so that a server
// that comes late needs no change before it.
//
// The key "records" of the bucket names the order, has the servers in the order of their slots, and
// tells where the copy is.
#pragma once

#include "cluster/jet.h"

#include <stdatomic.h>

struct shared_records;

// path: the database. name: this server's. Waits until this server is among those that share the
// records: at its first start NATS must answer, and another server must have given a copy. Where
// the records there are this server's alone, they are kept beside, and the log says so; but the
// first server's become those of all. RESULT_CLOSED: *ends became true. Other errors are those of
// the records.
enum result shared_records_create(struct jet *jet, const char *path, const char *name,
                                  const atomic_bool *ends, struct shared_records **out_records,
                                  struct error *err);
// Sends what waits, if NATS answers; else the next start does. NULL inside is fine.
void shared_records_destroy(struct shared_records **records);
