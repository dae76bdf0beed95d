// What a client of OpenIGTLink asks for and when, against servers that are played in no time.
#include "base/clock.h"
#include "igtl/framing.h"
#include "igtl/request.h"
#include "test.h"

#include <stdio.h>
#include <string.h>

static const int64_t step_ns = NS_PER_MS;

struct played {
    struct igtl_request request;
    struct igtl_framing framing;
    int64_t now_ns;
    int starts, gets, positions, resolution; // that were asked for; resolution: the newest
    int queue[4096], waiting, longest;       // GET_TRANS that wait for an answer, by tool
};

static int number_of(const struct played *p, const char *device) {
    int at = 0;
    while (at < p->request.tool_count && strcmp(p->request.tools[at].name, device) != 0)
        at++;
    return at;
}

// What the client sends at the present time.
static void hear(struct played *p) {
    uint8_t bytes[IGTL_REQUEST_BYTES_MAX];
    size_t size = igtl_request_next(&p->request, p->now_ns, bytes), at = 0;
    while (at < size) {
        enum igtl_framing_event event;
        struct igtl_frame frame;
        at += igtl_framing_feed(&p->framing, bytes + at, size - at, &event, &frame, NULL);
        if (event != IGTL_FRAMING_MESSAGE)
            continue;
        if (!strcmp(frame.type, "STT_TDATA")) {
            p->starts++;
            p->resolution = frame.body[2] << 8 | frame.body[3];
        }
        p->positions += !strcmp(frame.type, "GET_POSITION");
        if (strcmp(frame.type, "GET_TRANS") != 0)
            continue;
        assert_true(p->waiting < 4096);
        p->gets++;
        p->queue[p->waiting++] = number_of(p, frame.device);
        p->longest = p->waiting > p->longest ? p->waiting : p->longest;
    }
}

static void tell(struct played *p, const char *type, const char *tool) {
    static struct igtl_message message;
    message = (struct igtl_message){.count = 1, .version = 1};
    strcpy(message.type, type);
    strcpy(message.tools[0].name, tool);
    igtl_request_heard(&p->request, 1);
    igtl_request_answered(&p->request, &message, p->now_ns);
}

static void begin(struct played *p, enum igtl_request_kind kind, int tools) {
    memset(p, 0, sizeof *p);
    p->request.kind = kind;
    p->request.interval_ms = 5;
    p->request.tool_count = tools;
    for (int i = 0; i < tools; i++)
        snprintf(p->request.tools[i].name, sizeof p->request.tools[i].name, "tool-%d", i);
    p->now_ns = 5 * NS_PER_S;
    igtl_framing_init(&p->framing);
    igtl_request_begin(&p->request, p->now_ns);
}

// Answers one request after the other; of each `drops` one is not answered (0: all are).
static int serve_gets(struct played *p, int answer_ms, int drops, double seconds) {
    int answers = 0, taken = 0;
    int64_t end_ns = p->now_ns + (int64_t)(seconds * NS_PER_S), busy_ns = 0;
    for (; p->now_ns < end_ns; p->now_ns += step_ns) {
        hear(p);
        if (!p->waiting) {
            busy_ns = 0;
            continue;
        }
        busy_ns = busy_ns ? busy_ns : p->now_ns + answer_ms * NS_PER_MS;
        if (p->now_ns < busy_ns)
            continue;
        int tool = p->queue[0];
        memmove(p->queue, p->queue + 1, (size_t)--p->waiting * sizeof *p->queue);
        busy_ns = 0;
        if (drops && ++taken % drops == 0)
            continue;
        tell(p, "TRANSFORM", p->request.tools[tool].name);
        answers++;
    }
    return answers;
}

static void a_slow_server_is_not_asked_more_than_it_answers(void **state) {
    (void)state;
    static const int answer_ms[] = {1, 10, 60, 150};
    for (size_t i = 0; i < sizeof answer_ms / sizeof *answer_ms; i++) {
        static struct played p;
        begin(&p, IGTL_REQUEST_TRANSFORM, 3);
        int answers = serve_gets(&p, answer_ms[i], 0, 20);
        if (p.longest > 20 || p.waiting > 3 || p.gets > answers + 20)
            fail_msg("%d ms: %d asked, %d answered, %d wait, once %d", answer_ms[i], p.gets,
                     answers, p.waiting, p.longest);
        assert_true(answers > 17000 / (answer_ms[i] > 2 ? answer_ms[i] : 2)); // it has work
    }
}

static void one_tool_that_is_never_answered_does_not_slow_the_others_down(void **state) {
    (void)state;
    static struct played p;
    begin(&p, IGTL_REQUEST_TRANSFORM, 3);
    int answers[3] = {0};
    for (int64_t end_ns = p.now_ns + 10 * NS_PER_S; p.now_ns < end_ns; p.now_ns += step_ns) {
        hear(&p);
        for (; p.waiting; p.waiting--) {
            int tool = p.queue[p.waiting - 1];
            if (tool != 1)
                tell(&p, "TRANSFORM", p.request.tools[tool].name);
            answers[tool] += tool != 1;
        }
    }
    assert_in_range(answers[0], 1900, 2001); // each 5 ms
    assert_in_range(answers[2], 1900, 2001);
    assert_in_range(p.gets - answers[0] - answers[2], 15, 110);
}

static void lost_answers_are_asked_for_again(void **state) {
    (void)state;
    static struct played p;
    begin(&p, IGTL_REQUEST_TRANSFORM, 1);
    int answers = serve_gets(&p, 1, 5, 10);
    assert_true(answers > 150);
    assert_true(p.longest <= 3);
}

// PLUS sends a TDATA when the last one's time plus the resolution, as seconds, lies before now.
static void a_server_that_takes_the_resolution_for_seconds_is_asked_for_none(void **state) {
    (void)state;
    static const enum igtl_request_kind kinds[] = {IGTL_REQUEST_AUTO, IGTL_REQUEST_TDATA};
    for (int i = 0; i < 2; i++) {
        static struct played p;
        int poses = 0;
        double last_s = -1e3;
        begin(&p, kinds[i], 1);
        for (int64_t end_ns = p.now_ns + 5 * NS_PER_S; p.now_ns < end_ns;
             p.now_ns += 16 * NS_PER_MS) {
            hear(&p);
            double now_s = (double)p.now_ns / NS_PER_S;
            if (!p.starts || now_s - last_s <= p.resolution)
                continue;
            last_s = now_s;
            tell(&p, "TDATA", "tool-0");
            poses++;
        }
        assert_true(poses > 150);
        assert_int_equal(p.starts, 2);
        assert_int_equal(p.resolution, 0);
        assert_int_equal(p.gets + p.positions, 0);
    }
}

static void a_server_that_takes_it_for_milliseconds_is_asked_once(void **state) {
    (void)state;
    static struct played p;
    begin(&p, IGTL_REQUEST_AUTO, 1);
    for (int64_t end_ns = p.now_ns + 6 * NS_PER_S; p.now_ns < end_ns; p.now_ns += step_ns) {
        hear(&p);
        if (p.starts && p.now_ns / step_ns % 5 == 0)
            tell(&p, "TDATA", "tool-0");
    }
    assert_int_equal(p.starts, 1);
    assert_int_equal(p.resolution, 5);
}

// The request that was sent last is another one by then.
static void a_late_answer_is_known_by_its_type(void **state) {
    (void)state;
    static struct played p;
    int64_t begin_ns;
    begin(&p, IGTL_REQUEST_AUTO, 1);
    begin_ns = p.now_ns;
    for (; p.now_ns < begin_ns + 10 * NS_PER_S; p.now_ns += step_ns) {
        hear(&p);
        int64_t ms = (p.now_ns - begin_ns) / NS_PER_MS;
        if (ms >= 2300 && ms % 20 == 0)
            tell(&p, "TDATA", "tool-0");
    }
    assert_int_equal(p.request.asked, IGTL_REQUEST_TDATA);
    assert_true(p.positions <= 1);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_slow_server_is_not_asked_more_than_it_answers),
        cmocka_unit_test(one_tool_that_is_never_answered_does_not_slow_the_others_down),
        cmocka_unit_test(lost_answers_are_asked_for_again),
        cmocka_unit_test(a_server_that_takes_the_resolution_for_seconds_is_asked_for_none),
        cmocka_unit_test(a_server_that_takes_it_for_milliseconds_is_asked_once),
        cmocka_unit_test(a_late_answer_is_known_by_its_type),
    };
    return cmocka_run_group_tests_name("igtl_request", tests, NULL, NULL);
}
