#include "nodes.h"

#include "base/check.h"
#include "program.h"

#include <curl/curl.h>
#include <jansson.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define NATS "/usr/sbin/nats-server"

static enum result start(struct nodes *n, int node, int cpu, struct error *err) {
    char name[16], dir[FOLDER_MAX + 16], log[FOLDER_MAX + 16], port[16], monitor[16], route[64];
    char routes[NODES * 40] = "";
    for (int i = 0; i < NODES; i++)
        snprintf(routes + strlen(routes), sizeof routes - strlen(routes), "%snats://127.0.0.1:%d",
                 i ? "," : "", n->routes[i]);
    snprintf(name, sizeof name, "n%d", node);
    snprintf(dir, sizeof dir, "%s/n%d", n->folder, node);
    snprintf(log, sizeof log, "%s/n%d.log", n->folder, node);
    snprintf(port, sizeof port, "%d", n->ports[node]);
    snprintf(monitor, sizeof monitor, "%d", n->monitors[node]);
    snprintf(route, sizeof route, "nats://127.0.0.1:%d", n->routes[node]);
    struct program program = {{NATS, "--name", name, "-a", "127.0.0.1", "-p", port, "-m", monitor,
                               "-js", "-sd", dir, "--cluster_name", "bench", "--cluster", route,
                               "--routes", routes},
                              .log = log,
                              .cpu = cpu};
    return program_start(&program, &n->pids[node], NULL, err);
}

// A cluster without a leader yet answers nobody.
static enum result wait_for_leader(const struct nodes *n, struct error *err) {
    char log[FOLDER_MAX + 16];
    enum result result = RESULT_OK;
    for (int i = 0; i < NODES && result == RESULT_OK; i++) {
        snprintf(log, sizeof log, "%s/n%d.log", n->folder, i);
        result = program_wait(n->pids[i], log, "metadata leader", err);
    }
    return result;
}

enum result nodes_start(int cpu, struct nodes *n, struct error *err) {
    *n = (struct nodes){0};
    folder_make(n->folder);
    for (int i = 0; i < NODES; i++) {
        n->ports[i] = program_port();
        n->routes[i] = program_port();
        n->monitors[i] = program_port();
        snprintf(n->addresses + strlen(n->addresses), sizeof n->addresses - strlen(n->addresses),
                 "%snats://127.0.0.1:%d", i ? ", " : "", n->ports[i]);
    }
    enum result result =
        access(NATS, X_OK) ? fail(err, RESULT_MISSING, NATS " is not there") : RESULT_OK;
    for (int i = 0; i < NODES && result == RESULT_OK; i++)
        result = start(n, i, cpu, err);
    if (result == RESULT_OK)
        result = wait_for_leader(n, err);
    if (result != RESULT_OK)
        nodes_end(n);
    return result;
}

void nodes_end(struct nodes *n) {
    for (int i = 0; i < NODES; i++)
        program_end(&n->pids[i], SIGKILL);
    folder_remove(n->folder);
}

// ---- what it counts -----------------------------------------------------------------------------

static double bytes_of(const json_t *connections) {
    double bytes = 0;
    size_t i;
    json_t *one;
    json_array_foreach((json_t *)connections, i, one) {
        bytes += (double)json_integer_value(json_object_get(one, "in_bytes"));
    }
    return bytes;
}

static double ask(const char *url) {
    char *text = NULL;
    size_t size = 0;
    CURL *curl = curl_easy_init();
    FILE *out = open_memstream(&text, &size);
    NEED(curl && out, "memory");
    curl_easy_setopt(curl, CURLOPT_URL, url);
    curl_easy_setopt(curl, CURLOPT_WRITEDATA, out);
    curl_easy_perform(curl);
    curl_easy_cleanup(curl);
    fclose(out);
    json_t *answer = json_loadb(text, size, 0, NULL);
    double bytes = bytes_of(json_object_get(answer, "connections"));
    json_decref(answer);
    free(text);
    return bytes;
}

double nodes_bytes(const struct nodes *n) {
    char url[64];
    double bytes = 0;
    for (int i = 0; i < NODES; i++) {
        snprintf(url, sizeof url, "http://127.0.0.1:%d/connz", n->monitors[i]);
        bytes += ask(url);
    }
    return bytes;
}
