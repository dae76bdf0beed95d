// Three nats-servers of the system as one cluster, on loopback ports, in a folder of their own.
#pragma once

#include "base/result.h"
#include "folder.h"

#include <sys/types.h>

#define NODES 3

struct nodes {
    char folder[FOLDER_MAX];
    pid_t pids[NODES];
    int ports[NODES], routes[NODES], monitors[NODES];
    char addresses[NODES * 32]; // as in [cluster] nats
};

// cpu: where they run; -1: anywhere. RESULT_MISSING: nats-server is not there.
enum result nodes_start(int cpu, struct nodes *out_nodes, struct error *err);
void nodes_end(struct nodes *nodes);

// Bytes that all clients that are connected have sent so far.
double nodes_bytes(const struct nodes *nodes);
