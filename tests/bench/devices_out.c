// Poses out over OpenIGTLink: what three clients of the library's own classes miss, beside one that
// never reads.
#include "base/check.h"
#include "base/clock.h"
#include "devices.h"
#include "igtl/names.h"
#include "unit/library_client.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static const double rate_hz = 60;

enum { POSES = 2 * (CHANNEL_FIRST_DESCRIBED - CHANNEL_FEMUR) }; // as measured and as shown
enum { READS, ASKS_TDATA, ASKS_QTDATA, DEAF, CLIENTS, READERS = DEAF };

struct bench_out {
    pthread_t thread;
    bool quick;
    enum result result;
    struct error err;
    int sets, lost;
};

static const char *const types[READERS] = {"TRANSFORM", "TDATA", "QTDATA"};

static int count_of(struct library_client *client, const char *type) {
    int count = 0;
    for (int i = 0; i < library_client_count(client); i++)
        count += !strcmp(library_client_message(client, i).type, type);
    return count;
}

static bool answers(struct library_client *client, const char *type) {
    int64_t end_ns = clock_now_ns() + 10 * NS_PER_S;
    while (!count_of(client, type) && clock_now_ns() < end_ns)
        nanosleep(&(struct timespec){.tv_nsec = 5 * NS_PER_MS}, NULL);
    return count_of(client, type) > 0;
}

static bool connect_all(int port, struct library_client *clients[CLIENTS]) {
    clients[DEAF] = library_client_start_deaf(port);
    for (int i = 0; i < READERS; i++)
        clients[i] = library_client_start(port);
    for (int i = 0; i < CLIENTS; i++)
        if (!clients[i])
            return false;
    return library_client_ask(clients[ASKS_TDATA], 1, "STT_TDATA", "", 16) &&
           library_client_ask(clients[ASKS_QTDATA], 2, "STT_QTDATA", "", 16) &&
           library_client_ask(clients[READS], 1, "GET_STATUS", "", 0) &&
           answers(clients[ASKS_TDATA], "RTS_TDATA") &&
           answers(clients[ASKS_QTDATA], "RTS_QTDATA") && answers(clients[READS], "STATUS");
}

// All that a station knows of a mock-up with five instruments. Where it is late the next ones are
// as late, so that no two come together.
static int put_sets(struct igtl_server *server, double seconds) {
    int sets = (int)(seconds * rate_hz);
    for (int i = 0; i < sets; i++) {
        struct igtl_poses poses = {.utc_ns = clock_utc_ns()};
        for (int k = 0; k < POSES; k++) {
            struct igtl_pose *p = &poses.poses[poses.count++];
            *p = (struct igtl_pose){.utc_ns = poses.utc_ns, .T_world_body = pose_identity()};
            p->T_world_body.translation.x = i;
            igtl_pose_name((enum channel)(CHANNEL_FEMUR + k / 2), k % 2, p->name);
        }
        igtl_server_put_poses(server, &poses);
        sleep_until(clock_now_ns() + (int64_t)(NS_PER_S / rate_hz));
    }
    return sets;
}

static enum result run(struct bench_out *b) {
    const struct igtl_server_config config = {.device = IGTL_DEVICE};
    struct igtl_server *server;
    struct library_client *clients[CLIENTS] = {NULL};
    enum result result = igtl_server_create(&config, &server, &b->err);
    if (result != RESULT_OK)
        return result;
    struct igtl_state state = igtl_session_state("running", clock_utc_ns());
    igtl_server_put_status(server, &state);
    if (connect_all(igtl_server_port(server), clients))
        b->sets = put_sets(server, b->quick ? 3 : 20);
    else
        result = fail(&b->err, RESULT_IO, "a client of OpenIGTLink's classes gets no answer");
    igtl_server_destroy(&server);
    for (int i = 0; i < CLIENTS; i++) {
        int poses = i == READS ? POSES : 1;
        if (!clients[i])
            continue;
        library_client_wait(clients[i]);
        b->lost += i < READERS ? abs(poses * b->sets - count_of(clients[i], types[i])) : 0;
        library_client_end(clients[i]);
    }
    return result;
}

static void *run_thread(void *argument) {
    struct bench_out *b = argument;
    b->result = run(b);
    return NULL;
}

struct bench_out *bench_out_start(bool quick) {
    struct bench_out *b = alloc(1, sizeof *b);
    b->quick = quick;
    CHECK(pthread_create(&b->thread, NULL, run_thread, b) == 0);
    return b;
}

enum result bench_out_end(struct bench_out **out, struct report *report, struct error *err) {
    struct bench_out *b = *out;
    pthread_join(b->thread, NULL);
    enum result result = b->result;
    if (result == RESULT_OK) {
        report_figure(report, b->sets, "sets", "igtl_out/sets at 60 Hz");
        report_mark(report, "igtl_out_loss", b->lost, "messages", 0, BETTER_LOW);
    } else {
        *err = b->err;
    }
    free(b);
    *out = NULL;
    return result;
}
