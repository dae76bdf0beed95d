// Recorded sessions that are longer than what may wait for a page, and ones with steps missing, as
// pages get them.
#include "base/clock.h"
#include "live/live.h"
#include "live/playback_turns.h"
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
static const struct live_account anna = {.name = "anna", .role = "trainee", .trainee = "anna"};
static const struct live_account ben = {.name = "ben", .role = "trainee", .trainee = "ben"};
static const struct live_account cleo = {.name = "cleo", .role = "trainee", .trainee = "cleo"};

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
    if (trace_writer_create(path, &header, NULL, NULL, &writer, &err) != RESULT_OK)
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

// One batch; false: there is none now.
static bool draw(struct page *page) {
    static uint8_t bytes[LIVE_BATCH_MAX];
    int64_t next_ns;
    size_t size =
        live_server_batch(page->live, page->viewer, clock_now_ns(), bytes, sizeof bytes, &next_ns);
    read_batch(page, bytes, size);
    return size;
}

static void draw_to_the_end(struct page *page) {
    for (int i = 0; i < 20000 && !page->done; i++)
        if (!draw(page))
            hall_wait_ms(1);
    assert_true(page->done);
}

static void open_page(struct page *page, struct live_server *live,
                      const struct live_account *account) {
    *page = (struct page){.live = live, .viewer = live_server_join(live, account, "")};
    assert_non_null(page->viewer);
}

static void play(struct page *page, const char *case_name) {
    arthron_Page message = {.which_message = arthron_Page_watch_tag};
    arthron_Watch *w = &message.message.watch;
    w->what = arthron_Watch_What_RECORDED;
    w->rate_hz = 120;
    w->meshes = true;
    strcpy(w->session, ID);
    strcpy(w->case_name, case_name);
    live_server_take(page->live, page->viewer, &message);
}

static void watch(struct page *page, struct live_server *live, const char *case_name) {
    open_page(page, live, &instructor);
    play(page, case_name);
}

static void play_as(struct page *page, struct live_server *live,
                    const struct live_account *account) {
    open_page(page, live, account);
    play(page, "");
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
    live_server_on_news(live, ring, NULL, NULL);
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

static void a_page_that_takes_nothing_makes_room_for_others(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    struct live_server *live = open_live(sessions, 100);
    struct page idle[PLAYBACK_THREADS], last;
    int given_up = 0;
    record(sessions, 0, 0);
    for (int i = 0; i < PLAYBACK_THREADS; i++)
        watch(&idle[i], live, "");
    watch(&last, live, "");
    draw_to_the_end(&last);
    assert_int_equal(last.moments, STEPS);
    for (int i = 0; i < PLAYBACK_THREADS; i++) {
        draw_to_the_end(&idle[i]); // what waited, and why there is no more
        assert_true(idle[i].moments > 0);
        given_up += idle[i].moments < STEPS;
        if (idle[i].moments < STEPS)
            assert_non_null(strstr(idle[i].trouble, "took too little for long"));
    }
    assert_true(given_up > 0);
    for (int i = 0; i < PLAYBACK_THREADS; i++)
        live_server_leave(live, idle[i].viewer);
    live_server_leave(live, last.viewer);
    live_server_destroy(&live);
    sessions_destroy(&sessions);
}

// Each takes a batch now and then, but less than its share.
static void a_page_that_takes_little_makes_room_for_others(void **state) {
    (void)state;
    enum { PATIENCE_MS = 200, PAUSE_MS = 300 };
    struct sessions *sessions = hall_open();
    struct live_server *live = open_live(sessions, PATIENCE_MS);
    struct page slow[PLAYBACKS_OF_TRAINEES], last;
    record(sessions, 0, 0);
    play_as(&slow[0], live, &anna);
    play_as(&slow[1], live, &ben);
    play_as(&last, live, &cleo);
    for (int round = 0; round < 100 && !last.done; round++) {
        draw(&slow[0]);
        draw(&slow[1]);
        for (int ms = 0; ms < PAUSE_MS && !last.done; ms++)
            if (!draw(&last))
                hall_wait_ms(1);
    }
    assert_int_equal(last.moments, STEPS);
    draw_to_the_end(&slow[0]);
    draw_to_the_end(&slow[1]);
    assert_true(slow[0].moments < STEPS || slow[1].moments < STEPS);
    for (int i = 0; i < PLAYBACKS_OF_TRAINEES; i++)
        live_server_leave(live, slow[i].viewer);
    live_server_leave(live, last.viewer);
    live_server_destroy(&live);
    sessions_destroy(&sessions);
}

// None of whom draws anything, and one asks again and again.
static void trainees_leave_room_to_an_instructor(void **state) {
    (void)state;
    enum { PATIENCE_MS = 3600000, PAGES = 6, AGAIN = 300 };
    struct sessions *sessions = hall_open();
    struct live_server *live = open_live(sessions, PATIENCE_MS);
    struct page pages[PAGES], others[2], boss;
    record(sessions, 0, 0);
    for (int i = 0; i < PAGES; i++)
        play_as(&pages[i], live, &anna);
    play_as(&others[0], live, &ben);
    open_page(&others[1], live, &cleo);
    for (int i = 0; i < AGAIN; i++)
        play(&others[1], "");
    play_as(&boss, live, &instructor);
    draw_to_the_end(&boss);
    assert_int_equal(boss.moments, STEPS);
    for (int i = 2; i < PAGES; i++) {
        draw_to_the_end(&pages[i]);
        assert_non_null(strstr(pages[i].trouble, "as many recorded sessions as you may"));
    }
    live_server_leave(live, pages[0].viewer);
    draw_to_the_end(&pages[1]);
    assert_int_equal(pages[1].moments, STEPS);
    draw_to_the_end(&others[1]);
    assert_int_equal(others[1].moments, STEPS);
    for (int i = 1; i < PAGES; i++)
        live_server_leave(live, pages[i].viewer);
    live_server_leave(live, others[0].viewer);
    live_server_leave(live, others[1].viewer);
    live_server_leave(live, boss.viewer);
    live_server_destroy(&live);
    sessions_destroy(&sessions);
}

static void staff_play_first_and_each_person_one(void **state) {
    (void)state;
    struct playback_turn a = {.account = anna}, a2 = {.account = anna}, b = {.account = ben},
                         c = {.account = cleo}, o = {.account = instructor},
                         o2 = {.account = instructor};
    struct playback_turns turns;
    turns_init(&turns);
    turns_add(&turns, &a);
    turns_add(&turns, &a2);
    turns_add(&turns, &b);
    turns_add(&turns, &c);
    assert_ptr_equal(turns_take(&turns), &a);
    assert_ptr_equal(turns_take(&turns), &b); // a2 is the same person's
    assert_null(turns_take(&turns));          // the third thread is for staff
    turns_add(&turns, &o);
    turns_add(&turns, &o2);
    assert_ptr_equal(turns_take(&turns), &o);
    assert_null(turns_take(&turns));
    assert_true(turns_want(&turns, &b));
    turns_end(&turns, &b);
    assert_ptr_equal(turns_take(&turns), &c); // before anybody's second
    turns_end(&turns, &c);
    assert_ptr_equal(turns_take(&turns), &o2);
    assert_false(turns_want(&turns, &o)); // a2 waits for a
    assert_true(turns_want(&turns, &a));
    assert_false(turns_leave(&turns, &a));
    assert_true(turns_leave(&turns, &a2));
    turns_end(&turns, &a);
    assert_null(turns_take(&turns));
    turns_fini(&turns);
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
        cmocka_unit_test(a_page_that_takes_little_makes_room_for_others),
        cmocka_unit_test(trainees_leave_room_to_an_instructor),
        cmocka_unit_test(staff_play_first_and_each_person_one),
        cmocka_unit_test(behind_missing_steps_moments_go_on_and_meshes_do_not),
        cmocka_unit_test(on_another_case_it_ends_at_missing_steps),
        cmocka_unit_test(a_tissue_that_the_case_does_not_have_ends_it_and_is_told),
    };
    return cmocka_run_group_tests_name("playback", tests, hall_make, hall_remove);
}
