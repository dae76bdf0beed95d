#include "pipeline.h"

#include "base/check.h"
#include "base/clock.h"
#include "load.h"
#include "runtime/reply.h"
#include "step/session.h"
#include "trace/trace.h"
#include "wire/wire.h"

#include <pthread.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define THREADS 2
#define STATIONS 4  // of each thread
#define FRAMES 2000 // of each station in a round
#define STEP_NS (10 * NS_PER_MS)

struct datagram {
    size_t size;
    uint8_t data[WIRE_DATAGRAM_MAX];
};

struct station {
    struct session *session;
    struct trace_writer *trace;
    struct seal *out, *in, *back; // of the station's frames, both ends; of the replies
    uint64_t number;              // of its last frame
    struct datagram *frames;      // [FRAMES]
};

struct lane {
    const struct scene *scene;
    struct station stations[STATIONS];
    pthread_barrier_t *start;
    int cpu;
    int64_t begin_ns, end_ns;
};

// ---- stations -----------------------------------------------------------------------------------

static enum result open_station(const struct scene *scene, const char *folder, int index,
                                struct station *out, struct error *err) {
    static const uint8_t key[SEAL_KEY_SIZE] = "arthron benches", iv[SEAL_IV_SIZE] = "a known one";
    char path[128];
    struct session_settings settings = session_settings_default();
    struct trace_header header = {.settings = settings, .optic = view_optic_usual()};
    snprintf(path, sizeof path, "%s/pipeline-%d.trace", folder, index);
    remove(path);
    *out = (struct station){.session = session_create(scene, &settings),
                            .out = seal_create(SEAL_TO_SERVER, 0, 1, key, iv),
                            .in = seal_create(SEAL_TO_SERVER, 0, 1, key, iv),
                            .back = seal_create(SEAL_TO_STATION, 0, 1, key, iv),
                            .frames = alloc(FRAMES, sizeof(struct datagram))};
    struct session_output output;
    session_step(out->session, &(struct session_input){.kind = INPUT_START, .time_ns = 1}, &output);
    return trace_writer_create(path, &header, NULL, NULL, &out->trace, err);
}

static void close_station(struct station *station) {
    trace_writer_destroy(&station->trace);
    session_destroy(&station->session);
    seal_destroy(&station->out);
    seal_destroy(&station->in);
    seal_destroy(&station->back);
    free(station->frames);
}

static void seal_frames(struct station *station) {
    uint8_t bytes[WIRE_DATAGRAM_MAX - SEAL_OVERHEAD];
    for (int i = 0; i < FRAMES; i++) {
        arthron_Frame message;
        size_t size;
        struct frame frame = load_frame(station->number + 1, (int64_t)station->number * STEP_NS);
        station->number++;
        wire_frame_from(&frame, &message);
        wire_frame_pad(&message);
        CHECK(wire_encode_frame(&message, bytes, sizeof bytes, &size) == RESULT_OK);
        struct datagram *to = &station->frames[i];
        to->size = seal_seal(station->out, bytes, size, to->data);
    }
}

// ---- the worker's part --------------------------------------------------------------------------

static void serve(const struct scene *scene, struct station *station,
                  const struct datagram *datagram) {
    uint8_t message[WIRE_DATAGRAM_MAX], sealed[WIRE_DATAGRAM_MAX];
    size_t size;
    uint64_t sequence;
    struct session_input input = {.kind = INPUT_FRAME};
    struct session_output output;
    arthron_Reply reply;
    CHECK(seal_open(station->in, datagram->data, datagram->size, message, &size, &sequence));
    CHECK(wire_read_frame(message, size, &input.frame, NULL) == RESULT_OK);
    input.time_ns = input.frame.time_ns + 1;
    session_step(station->session, &input, &output);
    trace_append(station->trace, &input, &output);
    reply_from_output(&output, scene_case(scene), input.frame.number, input.frame.time_ns, &reply);
    CHECK(wire_encode_reply(&reply, message, size, &size) == RESULT_OK);
    seal_seal(station->back, message, size, sealed);
}

static void *serve_all(void *argument) {
    struct lane *lane = argument;
    cpu_set_t cpus;
    CPU_ZERO(&cpus);
    CPU_SET(lane->cpu, &cpus);
    pthread_setaffinity_np(pthread_self(), sizeof cpus, &cpus);
    pthread_barrier_wait(lane->start);
    lane->begin_ns = clock_now_ns();
    for (int i = 0; i < FRAMES; i++)
        for (int k = 0; k < STATIONS; k++)
            serve(lane->scene, &lane->stations[k], &lane->stations[k].frames[i]);
    lane->end_ns = clock_now_ns();
    return NULL;
}

// Poses a second of all threads together.
static double rate(struct lane *lanes, int count) {
    pthread_t threads[THREADS];
    pthread_barrier_t start;
    pthread_barrier_init(&start, NULL, (unsigned)count);
    for (int i = 0; i < count; i++) {
        for (int k = 0; k < STATIONS; k++)
            seal_frames(&lanes[i].stations[k]);
        lanes[i].start = &start;
    }
    for (int i = 0; i < count; i++)
        NEED(!pthread_create(&threads[i], NULL, serve_all, &lanes[i]), "thread");
    double sum = 0;
    for (int i = 0; i < count; i++) {
        pthread_join(threads[i], NULL);
        sum += (double)FRAMES * STATIONS * NS_PER_S / (double)(lanes[i].end_ns - lanes[i].begin_ns);
    }
    pthread_barrier_destroy(&start);
    return sum;
}

enum result pipeline_two_over_one(const struct scene *scene, const char *folder, int rounds,
                                  struct samples *out_ratios, struct error *err) {
    struct lane lanes[THREADS] = {{.scene = scene, .cpu = 0}, {.scene = scene, .cpu = 1}};
    enum result result = RESULT_OK;
    for (int i = 0; result == RESULT_OK && i < THREADS * STATIONS; i++)
        result = open_station(scene, folder, i, &lanes[i / STATIONS].stations[i % STATIONS], err);
    for (int i = 0; result == RESULT_OK && i <= rounds; i++) {
        double one = rate(lanes, 1), two = rate(lanes, THREADS);
        if (i > 0) // the first warms up
            samples_add(out_ratios, two / one);
    }
    for (int i = 0; i < THREADS * STATIONS; i++)
        if (lanes[i / STATIONS].stations[i % STATIONS].session)
            close_station(&lanes[i / STATIONS].stations[i % STATIONS]);
    return result;
}
