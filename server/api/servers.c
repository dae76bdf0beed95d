// The servers that share stations.
#include "api/servers.h"

#include "api/routes.h"
#include "base/check.h"

#include <stdlib.h>
#include <string.h>

int servers_read(const struct api *api, struct cluster_peer **out) {
    const struct api_cluster *cluster = api->config.cluster;
    *out = alloc(SERVERS_MAX, sizeof **out);
    return cluster ? cluster->peers(cluster->user, *out, SERVERS_MAX) : 0;
}

static void add(json_t *servers, const struct cluster_peer *peer, bool is_this) {
    json_array_append_new(servers,
                          json_pack("{s:o, s:o, s:b, s:b, s:i}", "name", call_string(peer->name),
                                    "pages", call_string(peer->pages), "lives", peer->lives, "this",
                                    is_this, "stations", peer->stations));
}

void get_servers(struct api_call *call) {
    const struct api_cluster *cluster = call->api->config.cluster;
    struct cluster_peer self, *peers;
    json_t *servers = json_array();
    if (cluster) {
        cluster->self(cluster->user, &self);
        add(servers, &self, true);
    }
    int count = servers_read(call->api, &peers);
    for (int i = 0; i < count; i++)
        add(servers, &peers[i], false);
    free(peers);
    call_answer(call, 200, json_pack("{s:o}", "servers", servers));
}
