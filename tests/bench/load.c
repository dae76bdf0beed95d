#include "load.h"

#include "base/check.h"
#include "base/clock.h"
#include "wire/wire.h"

#include <math.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#define ANSWER_MS 100 // later ones are lost
#define ANSWER_NS (ANSWER_MS * NS_PER_MS)
#define EVENTS 64
#define RADIUS_MM 6.0
#define SPEED_MM_S 30.0

struct frame load_frame(uint64_t number, int64_t now_ns) {
    double angle = SPEED_MM_S / RADIUS_MM * (double)(now_ns % (1000 * NS_PER_S)) / NS_PER_S;
    vec3 tip = {-19 + RADIUS_MM * cos(angle), RADIUS_MM * sin(angle), -20};
    struct frame frame = {.number = number, .time_ns = now_ns, .count = 2};
    frame.samples[0] = (struct sample){.channel = CHANNEL_JOINT, .time_ns = now_ns};
    frame.samples[0].joint.flexion_deg = 20;
    frame.samples[1] = (struct sample){.channel = CHANNEL_PROBE,
                                       .kind = SAMPLE_POSE,
                                       .time_ns = now_ns,
                                       .T_mockup_body = {{1, 0, 0, 0}, tip}};
    return frame;
}

// ---- one frame ----------------------------------------------------------------------------------

static void send_frame(struct caller *caller, int64_t now_ns, struct load_result *out) {
    uint8_t bytes[WIRE_DATAGRAM_MAX - SEAL_OVERHEAD], datagram[WIRE_DATAGRAM_MAX];
    size_t size;
    arthron_Frame message;
    struct frame frame = load_frame(++caller->number, now_ns);
    wire_frame_from(&frame, &message);
    wire_frame_pad(&message);
    enum result result = wire_encode_frame(&message, bytes, sizeof bytes, &size);
    CHECK(result == RESULT_OK);
    const uint8_t *data = bytes;
    if (caller->to_server) {
        size = seal_seal(caller->to_server, bytes, size, datagram);
        data = datagram;
    }
    caller->waits = send(caller->fd, data, size, MSG_DONTWAIT) >= 0;
    caller->sent_ns[caller->number % LOAD_FLIGHT] = caller->waits ? now_ns : 0;
    out->sent += caller->waits;
}

// The number of the frame that a datagram answers; 0: none.
static uint64_t answered(struct caller *caller, const uint8_t *datagram, size_t size) {
    uint8_t bytes[WIRE_DATAGRAM_MAX];
    uint64_t sequence;
    arthron_Frame frame;
    arthron_Reply reply;
    if (caller->to_station &&
        !seal_open(caller->to_station, datagram, size, bytes, &size, &sequence))
        return 0;
    const uint8_t *data = caller->to_station ? bytes : datagram;
    if (caller->echoes)
        return wire_decode_frame(data, size, &frame, NULL) == RESULT_OK ? frame.number : 0;
    return wire_decode_reply(data, size, &reply, NULL) == RESULT_OK ? reply.frame_number : 0;
}

static void take_answers(struct caller *caller, struct load_result *out) {
    uint8_t datagram[WIRE_DATAGRAM_MAX];
    ssize_t size;
    while ((size = recv(caller->fd, datagram, sizeof datagram, MSG_DONTWAIT)) > 0) {
        int64_t now_ns = clock_now_ns();
        uint64_t number = answered(caller, datagram, (size_t)size);
        int64_t *sent_ns = &caller->sent_ns[number % LOAD_FLIGHT];
        if (!number || !*sent_ns)
            continue;
        samples_add(&out->round_trips_us, (double)(now_ns - *sent_ns) / 1e3);
        *sent_ns = 0;
        out->answered++;
        if (number == caller->number)
            caller->waits = false;
    }
}

// ---- all of them --------------------------------------------------------------------------------

static bool is_due(const struct caller *caller, const struct load *load, int64_t now_ns) {
    int64_t sent_ns = caller->sent_ns[caller->number % LOAD_FLIGHT];
    return load->rate_hz > 0 ? now_ns >= caller->due_ns
                             : !caller->waits || now_ns - sent_ns > ANSWER_NS;
}

static void send_due(struct caller *callers, int count, const struct load *load,
                     struct load_result *out) {
    for (int i = 0; i < count; i++) {
        int64_t now_ns = clock_now_ns();
        if (!is_due(&callers[i], load, now_ns))
            continue;
        if (load->rate_hz > 0)
            callers[i].due_ns += (int64_t)(NS_PER_S / load->rate_hz);
        send_frame(&callers[i], now_ns, out);
    }
}

static int watch(struct caller *callers, int count) {
    int fd = epoll_create1(EPOLL_CLOEXEC);
    NEED(fd >= 0, "descriptor");
    for (int i = 0; i < count; i++) {
        struct epoll_event event = {.events = EPOLLIN, .data.ptr = &callers[i]};
        int failed = epoll_ctl(fd, EPOLL_CTL_ADD, callers[i].fd, &event);
        CHECK(!failed);
    }
    return fd;
}

static void spread(struct caller *callers, int count, const struct load *load) {
    int64_t now_ns = clock_now_ns();
    for (int i = 0; i < count; i++) {
        callers[i].waits = false;
        if (load->rate_hz > 0)
            callers[i].due_ns = now_ns + (int64_t)(NS_PER_S / load->rate_hz * i / count);
    }
}

// Whole milliseconds until the next frame of an open loop.
static int until_due_ms(const struct caller *callers, int count, int64_t now_ns) {
    int64_t least_ns = INT64_MAX;
    for (int i = 0; i < count; i++)
        if (callers[i].due_ns - now_ns < least_ns)
            least_ns = callers[i].due_ns - now_ns;
    return least_ns > 0 ? (int)(least_ns / NS_PER_MS) : 0;
}

// Usually it never sleeps: how soon it wakes would be in every figure.
void load_run(struct caller *callers, int count, const struct load *load, struct load_result *out) {
    struct epoll_event events[EVENTS];
    int fd = watch(callers, count);
    int64_t begin_ns = clock_now_ns();
    spread(callers, count, load);
    for (int64_t now_ns = begin_ns; now_ns - begin_ns < load->lasts_ns + ANSWER_NS;
         now_ns = clock_now_ns()) {
        if (now_ns - begin_ns < load->lasts_ns)
            send_due(callers, count, load, out);
        int wait_ms = load->sleeps ? until_due_ms(callers, count, now_ns) : 0;
        int ready = epoll_wait(fd, events, EVENTS, wait_ms < ANSWER_MS ? wait_ms : ANSWER_MS);
        for (int i = 0; i < ready; i++)
            take_answers(events[i].data.ptr, out);
    }
    close(fd);
}

void load_result_fini(struct load_result *result) {
    samples_fini(&result->round_trips_us);
    *result = (struct load_result){0};
}
