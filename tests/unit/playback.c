// Recorded sessions that are longer than what may wait for a page, and ones with steps missing, as
// pages get them.
#include "base/clock.h"
#include "live/live.h"
#include "test.h"
#include "unit/hall.h"
#include "wire/live.h"

#include <pb_decode.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define STEPS 6000
#define STEP_NS (10 * NS_PER_MS)
#define ID "00112233445566778899aabbccddeeff"

static const struct live_account instructor = {.name = "otto", .role = "instructor"};

// ---- a trace ------------------------------------------------------------------------------------

static void step(uint64_t number, struct trace_record *out) {
    *out = (struct trace_record){.type = TRACE_STEP};
    out->input.kind = number == 1 ? INPUT_START : INPUT_FRAME;
    out->input.time_ns = out->output.time_ns = (int64_t)number * STEP_NS;
    out->input.frame.number = out->output.frame_number = number;
    out->input.frame.time_ns = out->input.time_ns;
    out->output.step = number;
    out->output.state = SESSION_RUNNING;
    for (int i = 0; i < BODY_COUNT; i++)
        out->output.T_mockup_body[i] = out->output.T_mockup_virtual[i] = pose_identity();
    for (int i = 0; i < 2; i++) {
        struct instrument_output *instrument = &out->output.instruments[i];
        instrument->present = true;
        instrument->T_mockup_tip = instrument->T_mockup_warped = pose_identity();
        instrument->T_mockup_tip.translation.x = (double)number;
        instrument->warp.nearest = -1;
    }
}

static uint64_t forged; // the step that tells of a tissue which the case does not have; 0: none

// gap: behind this step so many are missing, a hundred; 0: none. case_hash: 0: the server's.
static void record(const struct sessions *sessions, uint64_t gap, uint64_t case_hash) {
    static struct trace_record one;
    char path[sizeof hall_dir + 64];
    struct trace_writer *writer;
    struct error err;
    struct trace_header header = {.case_hash = case_hash};
    if (!case_hash)
        header.case_hash = scene_case(sessions_scene(sessions, 0))->hash;
    header.settings = session_settings_default();
    header.optic = view_optic_usual();
    for (int i = 0; i < 16; i++)
        header.session_id[i] = (uint8_t)(i * 0x11);
    strcpy(header.station, "room-1");
    strcpy(header.case_name, "boxes0");
    trace_header_set_machine(&header);
    snprintf(path, sizeof path, "%s/traces/room-1-20260102T030405Z-%.8s.trace", hall_dir, ID);
    unlink(path);
    if (trace_writer_create(path, &header, NULL, &writer, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    for (uint64_t i = 1; i <= STEPS; i++) {
        step(gap && i > gap ? i + 100 : i, &one);
        if (i == forged)
            one.output.landed = (struct landed){.job = 1, .tissue = TISSUES_MAX - 1};
        assert_int_equal(trace_append_record(writer, &one, &err), RESULT_OK);
        if (i != gap)
            continue;
        one = (struct trace_record){.type = TRACE_GAP, .missing = 100};
        assert_int_equal(trace_append_record(writer, &one, &err), RESULT_OK);
    }
    trace_writer_destroy(&writer);
}

// ---- pages --------------------------------------------------------------------------------------

struct page {
    struct live_server *live;
    struct viewer *viewer;
    int moments, payloads, troubles;
    uint64_t last_step;
    bool done;
    char trouble[256]; // the last
};

static void take_item(struct page *page, const arthron_Live *item) {
    if (item->which_message == arthron_Live_moment_tag) {
        page->moments++;
        assert_true(item->message.moment.step > page->last_step);
        page->last_step = item->message.moment.step;
    } else if (item->which_message == arthron_Live_progress_tag) {
        page->done |= item->message.progress.done;
    } else if (item->which_message == arthron_Live_trouble_tag) {
        page->troubles++;
        snprintf(page->trouble, sizeof page->trouble, "%s", item->message.trouble.text);
    }
}

static void read_batch(struct page *page, const uint8_t *bytes, size_t size) {
    static arthron_Live item;
    pb_istream_t stream = pb_istream_from_buffer(bytes, size), inner;
    pb_wire_type_t type;
    uint32_t tag;
    bool end;
    while (stream.bytes_left) {
        assert_true(pb_decode_tag(&stream, &type, &tag, &end));
        assert_true(pb_make_string_substream(&stream, &inner));
        pb_istream_t peek = inner;
        assert_true(pb_decode_tag(&peek, &type, &tag, &end));
        if (tag == 5) { // a piece of a mesh
            page->payloads++;
            pb_read(&inner, NULL, inner.bytes_left);
        } else {
            assert_true(pb_decode(&inner, arthron_Live_fields, &item));
            take_item(page, &item);
        }
        assert_true(pb_close_string_substream(&stream, &inner));
    }
}

static void draw_to_the_end(struct page *page) {
    static uint8_t bytes[LIVE_BATCH_MAX];
    for (int i = 0; i < 20000 && !page->done; i++) {
        int64_t now_ns = clock_now_ns(), next_ns;
        size_t size =
            live_server_batch(page->live, page->viewer, now_ns, bytes, sizeof bytes, &next_ns);
        read_batch(page, bytes, size);
        if (!size)
            hall_wait_ms(1);
    }
    assert_true(page->done);
}

static void watch(struct page *page, struct live_server *live, const char *case_name) {
    arthron_Page message = {.which_message = arthron_Page_watch_tag};
    arthron_Watch *w = &message.message.watch;
    *page = (struct page){.live = live, .viewer = live_server_join(live, &instructor)};
    w->what = arthron_Watch_What_RECORDED;
    w->rate_hz = 120;
    w->meshes = true;
    strcpy(w->session, ID);
    strcpy(w->case_name, case_name);
    assert_true(live_server_take(live, page->viewer, &message));
}

static bool allow(void *user, const struct live_account *account, const char *session) {
    (void)user, (void)account, (void)session;
    return true;
}

static struct live_server *open_live(struct sessions *sessions, int patience_ms) {
    const struct live_config config = {.allowed = allow, .patience_ms = patience_ms};
    return live_server_create(sessions, &config);
}

// ---- the tests ----------------------------------------------------------------------------------

static atomic_int rung; // once for each parcel

static void ring(void *user) {
    (void)user;
    atomic_fetch_add(&rung, 1);
}

// What is sent when nothing has been added for a while.
static int settled(void) {
    int last = -1;
    for (int quiet = 0; quiet < 20; quiet++) {
        if (atomic_load(&rung) != last)
            quiet = 0;
        last = atomic_load(&rung);
        hall_wait_ms(20);
    }
    return last;
}

static void messages_that_wait_for_a_page_are_bounded_and_not_lost(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    struct live_server *live = open_live(sessions, 0);
    struct page page;
    record(sessions, 0, 0);
    atomic_store(&rung, 0);
    live_server_on_news(live, ring, NULL);
    watch(&page, live, "");
    int waiting = settled(); // nobody draws
    draw_to_the_end(&page);
    assert_true(atomic_load(&rung) > 2 * waiting);
    assert_int_equal(page.moments, STEPS);
    assert_int_equal(page.troubles, 0);
    live_server_leave(live, page.viewer);
    live_server_destroy(&live);
    sessions_destroy(&sessions);
}

// Two are played at a time.
static void a_page_that_takes_nothing_makes_room_for_others(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    struct live_server *live = open_live(sessions, 100);
    struct page idle[2], third;
    record(sessions, 0, 0);
    for (int i = 0; i < 2; i++)
        watch(&idle[i], live, "");
    watch(&third, live, "");
    draw_to_the_end(&third);
    assert_int_equal(third.moments, STEPS);
    for (int i = 0; i < 2; i++) {
        draw_to_the_end(&idle[i]); // what waited, and why there is no more
        if (idle[i].moments < STEPS)
            assert_non_null(strstr(idle[i].trouble, "took nothing for long"));
    }
    assert_true(idle[0].moments < STEPS || idle[1].moments < STEPS);
    assert_true(idle[0].moments > 0 && idle[1].moments > 0);
    for (int i = 0; i < 2; i++)
        live_server_leave(live, idle[i].viewer);
    live_server_leave(live, third.viewer);
    live_server_destroy(&live);
    sessions_destroy(&sessions);
}

static void behind_missing_steps_moments_go_on_and_meshes_do_not(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    struct live_server *live = open_live(sessions, 0);
    struct page page;
    record(sessions, 4000, 0);
    watch(&page, live, "");
    draw_to_the_end(&page);
    assert_int_equal(page.troubles, 1);
    assert_non_null(strstr(page.trouble, "the meshes stay as they were"));
    assert_int_equal(page.moments, STEPS);
    assert_int_equal(page.last_step, STEPS + 100);
    assert_true(page.payloads > 0);
    live_server_leave(live, page.viewer);
    live_server_destroy(&live);
    sessions_destroy(&sessions);
}

static void on_another_case_it_ends_at_missing_steps(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    struct live_server *live = open_live(sessions, 0);
    struct page page;
    record(sessions, 1000, 7);
    watch(&page, live, "boxes1");
    draw_to_the_end(&page);
    assert_int_equal(page.troubles, 1);
    assert_non_null(strstr(page.trouble, "it ends here"));
    assert_int_equal(page.last_step, 1000);
    live_server_leave(live, page.viewer);
    live_server_destroy(&live);
    sessions_destroy(&sessions);
}

static void a_tissue_that_the_case_does_not_have_ends_it_and_is_told(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    struct live_server *live = open_live(sessions, 0);
    struct page page;
    forged = 2000;
    record(sessions, 0, 0);
    forged = 0;
    watch(&page, live, "");
    draw_to_the_end(&page);
    assert_int_equal(page.troubles, 1);
    assert_non_null(strstr(page.trouble, "names a part that its case does not have"));
    assert_int_equal(page.last_step, 1999);
    live_server_leave(live, page.viewer);
    live_server_destroy(&live);
    sessions_destroy(&sessions);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(messages_that_wait_for_a_page_are_bounded_and_not_lost),
        cmocka_unit_test(a_page_that_takes_nothing_makes_room_for_others),
        cmocka_unit_test(behind_missing_steps_moments_go_on_and_meshes_do_not),
        cmocka_unit_test(on_another_case_it_ends_at_missing_steps),
        cmocka_unit_test(a_tissue_that_the_case_does_not_have_ends_it_and_is_told),
    };
    return cmocka_run_group_tests_name("playback", tests, hall_make, hall_remove);
}
