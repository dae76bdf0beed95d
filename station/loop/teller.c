#include "loop/teller.h"

#include "base/check.h"
#include "base/log.h"
#include "base/task_pool.h"

#include <inttypes.h>
#include <math.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define WAITING_MAX 2

struct telling {
    struct teller *teller;
    struct told_second second;
};

struct teller {
    struct runner *runner;
    struct link *link;
    bool live;
    struct task_pool *writer;
    // The writer's own.
    uint64_t markers_lost_told;
    uint64_t holds_logged; // of which connection
    bool was_lost[RUNNER_DEVICES_MAX];
};

static const char *path_name(enum link_path path) {
    return path == LINK_DATAGRAM ? "datagrams" : path == LINK_CONTROL ? "control" : "no link";
}

// What the slowest filter adds to the newest poses.
static double filter_latency_ms(struct teller *teller) {
    double most = 0;
    for (int i = 0; i < runner_count(teller->runner); i++) {
        struct device_status status;
        runner_status(teller->runner, i, &status);
        most = fmax(most, status.filter_latency_ms);
    }
    return most;
}

// Nobody may read what is written.
static bool stdout_has_room(void) {
    struct pollfd out = {.fd = STDOUT_FILENO, .events = POLLOUT};
    return poll(&out, 1, 0) == 1 && out.revents & POLLOUT;
}

static void print_live(struct teller *teller, const struct told_second *second) {
    struct link_status status;
    link_get_status(teller->link, &status);
    char more[128] = "";
    double latency_ms = filter_latency_ms(teller);
    if (latency_ms > 0)
        snprintf(more, sizeof more, "  filter %.1f ms", latency_ms);
    if (second->alignment_ms > 0)
        snprintf(more + strlen(more), sizeof more - strlen(more), "  alignment %.1f ms",
                 second->alignment_ms);
    if (second->pressed.time_ns)
        snprintf(more + strlen(more), sizeof more - strlen(more), "  force %.1f N (%s)",
                 second->pressed.force_n, channel_name(second->pressed.channel));
    printf("%5" PRIu64
           " poses/s  round trip %6.0f us p50 %6.0f us p99  warp %5.2f mm  unanswered %" PRIu64
           "%s  %s%s%s\n",
           second->warped, second->p50_us, second->p99_us, second->warp_mm, second->unanswered,
           more, path_name(status.path), status.refusal[0] ? ": " : "", status.refusal);
    fflush(stdout);
}

static void log_devices(struct teller *teller) {
    for (int i = 0; i < runner_count(teller->runner); i++) {
        struct device_status status;
        runner_status(teller->runner, i, &status);
        bool lost = !status.connected || status.problem[0];
        if (lost && !teller->was_lost[i])
            log_warning("device", "%s: %s", status.name,
                        status.problem[0] ? status.problem : "not connected yet");
        if (!lost && teller->was_lost[i])
            log_info("device", "%s: back", status.name);
        teller->was_lost[i] = lost;
    }
}

// Once for each connection: the server's hold cuts a longer one short.
static void log_holds(struct teller *teller) {
    struct link_status link;
    link_get_status(teller->link, &link);
    if (!link.welcomed || !link.hold_ms || link.connects == teller->holds_logged)
        return;
    teller->holds_logged = link.connects;
    for (int i = 0; i < runner_count(teller->runner); i++) {
        struct device_status device;
        runner_status(teller->runner, i, &device);
        if (device.hold_ms > link.hold_ms)
            log_warning(
                "station",
                "[device %s] hold_ms = %g: the server calls a value lost after %d ms. Raise "
                "hold_ms in its [warp]",
                device.name, device.hold_ms, link.hold_ms);
    }
}

// What found no room on its way to the server, and what came too fast from a device.
static void log_markers(struct teller *teller, const struct told_second *second) {
    uint64_t lost = second->markers_lost;
    for (int i = 0; i < runner_count(teller->runner); i++) {
        struct device_status status;
        runner_status(teller->runner, i, &status);
        lost += status.markers_lost;
    }
    if (lost > teller->markers_lost_told)
        log_warning("station",
                    "%" PRIu64 " markers were lost: they came too fast, or too many wait for the "
                    "server, or it takes none",
                    lost - teller->markers_lost_told);
    teller->markers_lost_told = lost;
}

static void forget(void *data, bool done) {
    (void)done;
    free(data);
}

static int64_t tell(void *data) {
    const struct telling *telling = data;
    struct teller *teller = telling->teller;
    log_holds(teller);
    log_markers(teller, &telling->second);
    if (teller->live && stdout_has_room())
        print_live(teller, &telling->second);
    log_devices(teller);
    return TASK_DONE;
}

struct teller *teller_create(struct runner *runner, struct link *link, bool live) {
    const struct task_pool_settings settings = {.threads = 1, .tasks_max = WAITING_MAX};
    struct teller *teller = alloc(1, sizeof *teller);
    teller->runner = runner;
    teller->link = link;
    teller->live = live;
    teller->writer = task_pool_create(&settings);
    return teller;
}

void teller_tell(struct teller *teller, const struct told_second *second) {
    struct telling *telling = alloc(1, sizeof *telling);
    *telling = (struct telling){teller, *second};
    if (!task_pool_add(teller->writer,
                       &(struct pool_task){.run = tell, .finish = forget, .data = telling}))
        free(telling);
}

void teller_destroy(struct teller **teller) {
    if (!*teller)
        return;
    task_pool_drain((*teller)->writer);
    task_pool_destroy(&(*teller)->writer);
    free(*teller);
    *teller = NULL;
}
