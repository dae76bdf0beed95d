// A worker: one thread, one datagram socket, the sessions of its stations. It waits for no other
// thread: it exchanges rings and newest values with them, its sends do not block, and a trace only
// copies.
#pragma once

#include "runtime/parts.h"

enum result worker_start(struct runtime *runtime, int index, struct error *err);
void worker_stop(struct worker *worker);    // ends its sessions, joins, closes the socket
void worker_release(struct worker *worker); // its rings, once no other thread uses them

// Wakes the worker. False where it has too much to do.
bool worker_request(struct worker *worker, const struct worker_request *request);
