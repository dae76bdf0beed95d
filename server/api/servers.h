// The servers that share stations.
#pragma once

#include "api/call.h"

#define SERVERS_MAX 1024

// The others that are known; free them. None where this server is alone.
int servers_read(const struct api *api, struct cluster_peer **out_peers);
