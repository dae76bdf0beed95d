// What pages are told that look on: of the newest, no more than they take, and all of it in the
// end.
#include "base/clock.h"
#include "test.h"
#include "unit/live_page.h"

#include <stdatomic.h>
#include <stdio.h>
#include <string.h>

static void a_wall_gets_the_newest_at_its_rate_and_nothing_twice(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    struct live_server *live = open_live(sessions);
    struct page slow, fast;
    hall_join(sessions);
    open_page(&slow, live, &technician);
    open_page(&fast, live, &instructor);
    watch(&slow, arthron_Watch_What_WALL, "", 5);
    watch(&fast, arthron_Watch_What_WALL, "", 50);
    int64_t begin_ns = clock_now_ns();
    for (int i = 0; i < 100; i++) {
        hall_frame(sessions, (vec3){0, 0, 20});
        hall_wait_ms(5);
        draw(&slow);
        draw(&fast);
    }
    double seconds = (double)(clock_now_ns() - begin_ns) / NS_PER_S;
    assert_true(slow.moments >= 2 && slow.moments <= 5 * seconds + 2);
    assert_true(fast.moments > slow.moments && fast.moments <= 50 * seconds + 2);
    assert_false(slow.fell || fast.fell);
    assert_true(slow.places >= 1 && slow.places <= seconds + 3);
    assert_string_equal(fast.place.info.station, "room-1");
    assert_int_equal(fast.place.info.state, arthron_SessionState_RUNNING);
    close_page(&slow);
    close_page(&fast);
    live_server_destroy(&live);
    sessions_destroy(&sessions);
}

// What was lost while nobody looked is none of the last second's.
static void the_first_place_tells_of_no_time_before_it(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    struct live_server *live = open_live(sessions);
    struct station_counts *counts = hall_counts(sessions);
    struct page page;
    hall_join(sessions);
    atomic_store(&counts->frames_lost, 1000);
    atomic_store(&counts->warp_nm, 5000000);
    open_page(&page, live, &instructor);
    watch(&page, arthron_Watch_What_WALL, "", 5);
    draw_until(&page, &page.places, 1);
    assert_true(page.place.loss_share == 0 && page.place.warp_mm == 0);
    atomic_store(&counts->frames_lost, 2000);
    atomic_store(&counts->warp_nm, 5000000);
    draw_until(&page, &page.places, 2);
    assert_true(page.place.loss_share > 0.5f && page.place.warp_mm == 5);
    close_page(&page);
    live_server_destroy(&live);
    sessions_destroy(&sessions);
}

static void a_page_that_draws_nothing_gets_one_moment_when_it_does(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    struct live_server *live = open_live(sessions);
    struct page page;
    hall_join(sessions);
    open_page(&page, live, &instructor);
    watch(&page, arthron_Watch_What_STATION, "room-1", 120);
    page.meshes = false;
    draw_until(&page, &page.moments, 1);
    int before = page.moments;
    for (int i = 0; i < 50; i++)
        hall_frame(sessions, (vec3){0, 0, 20});
    hall_wait_ms(100);
    draw(&page);
    assert_int_equal(page.moments, before + 1);
    assert_int_equal(page.sessions, 1);
    close_page(&page);
    live_server_destroy(&live);
    sessions_destroy(&sessions);
}

static void pages_have_the_mesh_that_was_cut(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    struct live_server *live = open_live(sessions);
    struct page page, sleeper, late;
    hall_join(sessions);
    open_page(&page, live, &instructor);
    open_page(&sleeper, live, &instructor);
    open_page(&late, live, &technician);
    watch(&page, arthron_Watch_What_STATION, "room-1", 60);
    watch(&sleeper, arthron_Watch_What_STATION, "room-1", 60);
    draw_until(&page, &page.payloads, 1);
    draw_until(&sleeper, &sleeper.sessions, 1); // asks, and then takes nothing
    assert_int_equal(page.tissue.number, 1);
    for (int i = 0; i < 2; i++) {
        hall_shave(sessions);
        draw_for(&page, 50);
    }
    struct tissue_report report = hall_last_tissues(sessions);
    watch(&late, arthron_Watch_What_STATION, "room-1", 60);
    struct page *all[] = {&page, &sleeper, &late};
    for (int i = 0; i < 3; i++) {
        draw_until_shown(all[i], &report);
        assert_int_equal(all[i]->tissue.number, report.figures[0].mesh_number);
        assert_int_equal(all[i]->tissue.hash, report.mesh_hashes[0]);
        assert_int_equal(all[i]->resection.cuts, report.figures[0].cuts);
        assert_int_equal(all[i]->resection.mesh_hash, report.mesh_hashes[0]);
    }
    assert_true(report.figures[0].cuts >= 5);
    assert_true(page.payloads >= 3);
    assert_true(sleeper.payloads <= 2); // the one that lay there, and all since
    assert_int_equal(late.payloads, 1);
    for (int i = 0; i < 3; i++)
        close_page(all[i]);
    live_server_destroy(&live);
    sessions_destroy(&sessions);
}

static void a_new_session_has_a_new_mesh(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    struct live_server *live = open_live(sessions);
    struct page page;
    hall_join(sessions);
    open_page(&page, live, &instructor);
    watch(&page, arthron_Watch_What_STATION, "room-1", 60);
    draw_until(&page, &page.payloads, 1);
    arthron_LiveSession first = page.session;
    uint64_t whole = page.tissue.hash;
    hall_shave(sessions);
    struct tissue_report report = hall_last_tissues(sessions);
    draw_until_shown(&page, &report);
    assert_true(page.tissue.number > 1);
    page.payloads = 0;
    hall_command(sessions, arthron_Command_Kind_CASE); // of the same boxes
    draw_until(&page, &page.payloads, 1);
    assert_int_equal(page.sessions, 2);
    assert_memory_not_equal(page.session.id, first.id, sizeof first.id);
    assert_string_equal(page.session.case_name, "boxes1");
    assert_float_equal(page.session.optic_deg, 70, 0);
    assert_float_equal(page.session.optic_view_deg, 105, 0);
    draw_for(&page, 100);
    assert_int_equal(page.tissue.number, 1);
    assert_int_equal(page.tissue.hash, whole);
    assert_int_equal(page.resection.cuts, 0);
    close_page(&page);
    live_server_destroy(&live);
    sessions_destroy(&sessions);
}

static void a_page_that_looks_again_gets_all_remarks_again(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    struct live_server *live = open_live(sessions);
    struct page page;
    hall_join(sessions);
    open_page(&page, live, &instructor);
    watch(&page, arthron_Watch_What_STATION, "room-1", 60);
    draw_until(&page, &page.sessions, 1);
    command(&page, arthron_Command_Kind_NOTE, "Slowly");
    draw_until(&page, &page.remarks, 1);
    watch(&page, arthron_Watch_What_STATION, "room-1", 60);
    draw_until(&page, &page.remarks, 2);
    assert_int_equal(page.sessions, 2);
    assert_string_equal(page.remark.text, "Slowly");
    close_page(&page);
    live_server_destroy(&live);
    sessions_destroy(&sessions);
}

static void assert_is_first_marker(const struct page *page, int64_t time_ns) {
    assert_int_equal(page->marker.number, 1);
    assert_int_equal(page->marker.time_ns, time_ns);
    assert_string_equal(page->marker.name, "start");
    assert_string_equal(page->marker.device, "pedal");
    assert_float_equal(page->marker.value, 1, 0);
}

static void pages_get_each_marker_once_live_and_from_the_record(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    struct live_server *live = open_live(sessions);
    struct page page;
    char id[33] = "";
    hall_join(sessions);
    open_page(&page, live, &instructor);
    watch(&page, arthron_Watch_What_STATION, "room-1", 120);
    draw_until(&page, &page.sessions, 1);
    struct session_about about = hall_status(sessions).about;
    int64_t now_ns = clock_now_ns();
    hall_mark(sessions, 1, now_ns);
    draw_until(&page, &page.markers, 1);
    assert_is_first_marker(&page, now_ns - about.start_ns);
    draw_for(&page, 50);
    assert_int_equal(page.markers, 1);
    watch(&page, arthron_Watch_What_STATION, "room-1", 120); // again, as after a lost connection
    draw_until(&page, &page.markers, 2);
    hall_command(sessions, arthron_Command_Kind_STOP);
    for (size_t i = 0; i < sizeof about.id; i++)
        snprintf(id + 2 * i, 3, "%02x", about.id[i]);
    page.markers = 0;
    watch(&page, arthron_Watch_What_RECORDED, id, 10);
    draw_until(&page, &page.markers, 1);
    assert_is_first_marker(&page, now_ns - about.start_ns);
    close_page(&page);
    live_server_destroy(&live);
    sessions_destroy(&sessions);
}

// What is cached of a station may be older than its session.
static void metrics_are_of_the_session_that_is_shown(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    struct live_server *live = open_live(sessions);
    struct page early, late;
    int64_t second_ns = (clock_now_ns() / NS_PER_S + 1) * NS_PER_S;
    hall_join(sessions);
    hall_wait_ms(300); // until its metrics have a time
    open_page(&early, live, &instructor);
    open_page(&late, live, &instructor);
    watch(&early, arthron_Watch_What_STATION, "room-1", 1);
    draw_at(&early, second_ns + 3 * NS_PER_S / 10);
    draw_at(&early, second_ns + NS_PER_S);
    draw_at(&early, second_ns + 2 * NS_PER_S);
    assert_int_equal(early.metrics, 1);
    double first_s = early.time_s;
    hall_command(sessions, arthron_Command_Kind_STOP);
    hall_command(sessions, arthron_Command_Kind_START);
    watch(&late, arthron_Watch_What_STATION, "room-1", 1);
    draw_at(&late, second_ns + 24 * NS_PER_S / 10); // it is shown the session as it was at 2 s
    assert_memory_equal(late.session.id, early.session.id, sizeof late.session.id);
    assert_float_equal(late.time_s, first_s, 0);
    draw_at(&early, second_ns + 3 * NS_PER_S);
    assert_int_equal(early.sessions, 2);
    assert_int_equal(early.metrics, 2);
    assert_true(early.time_s != first_s);
    close_page(&early);
    close_page(&late);
    live_server_destroy(&live);
    sessions_destroy(&sessions);
}

// Cuts a session, ends it, and returns what it came to.
static struct tissue_report record(struct sessions *sessions, char out_id[33]) {
    hall_join(sessions);
    hall_shave_part(sessions, 0, 0.6);
    hall_command(sessions, arthron_Command_Kind_PAUSE); // which ends the burr's stroke
    hall_command(sessions, arthron_Command_Kind_START);
    hall_shave_part(sessions, 0.6, 1);
    hall_command(sessions, arthron_Command_Kind_UNDO);
    struct tissue_report report = hall_last_tissues(sessions);
    hall_command(sessions, arthron_Command_Kind_STOP);
    for (int i = 0; i < 16; i++)
        snprintf(out_id + 2 * i, 3, "%02x", hall_status(sessions).session_id[i]);
    hall_leave(sessions);
    hall_wait_ms(300); // until the trace has its end
    return report;
}

static void a_recorded_session_comes_to_what_it_came_to(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    struct live_server *live = open_live(sessions);
    struct page page;
    char id[33];
    struct tissue_report report = record(sessions, id);
    open_page(&page, live, &instructor);
    watch(&page, arthron_Watch_What_RECORDED, id, 10);
    for (int i = 0; i < 10000 && !page.done; i++)
        if (draw(&page) > clock_now_ns())
            hall_wait_ms(1);
    assert_true(page.done);
    assert_int_equal(page.troubles, 0);
    assert_true(page.session.recorded);
    assert_float_equal(page.session.optic_deg, 70, 0);
    assert_float_equal(page.session.optic_view_deg, 105, 0);
    assert_int_equal(page.sessions, 1);
    assert_true(report.figures[0].cuts >= 3);
    assert_int_equal(page.tissue.number, report.figures[0].mesh_number);
    assert_int_equal(page.tissue.hash, report.mesh_hashes[0]);
    assert_int_equal(page.resection.mesh_hash, report.mesh_hashes[0]);
    assert_float_equal(page.resection.volume_mm3, report.figures[0].volume_mm3, 0);
    assert_int_equal(page.payloads, report.figures[0].mesh_number); // each change at its moment
    assert_true(page.moments >= page.payloads - 1);
    assert_true(page.session.length_ns >= page.last_ns);
    assert_true(page.session.length_ns <= page.last_ns + NS_PER_S);
    assert_int_equal(page.metrics, 1);
    assert_false(page.fell);
    close_page(&page);
    live_server_destroy(&live);
    sessions_destroy(&sessions);
}

static void a_recorded_session_waits_for_its_page_and_not_for_others(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    struct live_server *live = open_live(sessions);
    struct page pages[3], other;
    char id[33];
    record(sessions, id);
    for (int i = 0; i < 3; i++) {
        open_page(&pages[i], live, &instructor);
        watch(&pages[i], arthron_Watch_What_RECORDED, id, 120);
    }
    open_page(&other, live, &trainee);
    watch(&other, arthron_Watch_What_RECORDED, id, 120);
    close_page(&pages[0]); // in the middle of it
    for (int k = 2; k >= 1; k--)
        for (int i = 0; i < 60000 && !pages[k].done; i++)
            if (draw(&pages[k]) > clock_now_ns())
                hall_wait_ms(1);
    assert_true(pages[1].done && pages[2].done);
    assert_int_equal(pages[1].tissue.hash, pages[2].tissue.hash);
    draw_until(&other, &other.troubles, 1);
    assert_int_equal(other.trouble_kind, arthron_Trouble_Kind_NOT_THERE);
    draw_for(&other, 100);
    assert_true(other.done);
    assert_int_equal(other.moments + other.sessions + other.payloads, 0);
    close_page(&pages[1]);
    close_page(&pages[2]);
    close_page(&other);
    live_server_destroy(&live);
    sessions_destroy(&sessions);
}

static atomic_int rung;

static void ring(void *user) {
    (void)user;
    atomic_fetch_add(&rung, 1);
}

static void a_page_is_rung_for_what_it_waits_for(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    struct live_server *live = open_live(sessions);
    struct page page;
    live_server_on_news(live, ring, NULL, NULL);
    open_page(&page, live, &instructor);
    command(&page, arthron_Command_Kind_LIST, "");
    for (int i = 0; i < 2000 && !atomic_load(&rung); i++)
        hall_wait_ms(1);
    assert_int_equal(atomic_load(&rung), 1);
    live_server_on_news(live, NULL, NULL, NULL);
    command(&page, arthron_Command_Kind_LIST, "");
    draw_until(&page, &page.replies, 2);
    assert_int_equal(atomic_load(&rung), 1);
    close_page(&page);
    live_server_destroy(&live);
    sessions_destroy(&sessions);
}

static void acknowledge_wrongly(struct page *page) {
    arthron_Page message = {.which_message = arthron_Page_mesh_ack_tag};
    arthron_MeshState *ack = &message.message.mesh_ack;
    strcpy(ack->group, page->resection.group);
    ack->number = page->tissue.number;
    ack->hash = page->tissue.hash + 1;
    say(page, &message);
}

// Much more often than it may. Each payload rings.
static void a_page_that_asks_for_meshes_without_end_waits(void **state) {
    (void)state;
    enum { TIMES = 20000, FEW = 1000 };
    struct sessions *sessions = hall_open();
    struct live_server *live = open_live(sessions);
    struct page greedy, other;
    hall_join(sessions);
    open_page(&greedy, live, &instructor);
    open_page(&other, live, &technician);
    watch(&greedy, arthron_Watch_What_STATION, "room-1", 60);
    draw_until(&greedy, &greedy.payloads, 1);
    draw_until(&greedy, &greedy.resections, 1);
    atomic_store(&rung, 0);
    live_server_on_news(live, ring, NULL, NULL);
    for (int i = 0; i < TIMES; i++)
        ask_for_meshes(&greedy);
    hall_wait_ms(50);
    for (int i = 0; i < TIMES; i++)
        acknowledge_wrongly(&greedy);
    hall_wait_ms(50);
    assert_in_range(atomic_load(&rung), 1, FEW);
    watch(&other, arthron_Watch_What_STATION, "room-1", 60);
    draw_until(&other, &other.payloads, 1);
    hall_shave(sessions);
    struct tissue_report report = hall_last_tissues(sessions);
    draw_until_shown(&other, &report);
    draw_until_shown(&greedy, &report);
    assert_int_equal(other.tissue.hash, report.mesh_hashes[0]);
    assert_int_equal(greedy.tissue.hash, report.mesh_hashes[0]);
    close_page(&greedy);
    close_page(&other);
    live_server_destroy(&live);
    sessions_destroy(&sessions);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_wall_gets_the_newest_at_its_rate_and_nothing_twice),
        cmocka_unit_test(the_first_place_tells_of_no_time_before_it),
        cmocka_unit_test(a_page_that_draws_nothing_gets_one_moment_when_it_does),
        cmocka_unit_test(pages_have_the_mesh_that_was_cut),
        cmocka_unit_test(a_new_session_has_a_new_mesh),
        cmocka_unit_test(a_page_that_looks_again_gets_all_remarks_again),
        cmocka_unit_test(pages_get_each_marker_once_live_and_from_the_record),
        cmocka_unit_test(metrics_are_of_the_session_that_is_shown),
        cmocka_unit_test(a_recorded_session_comes_to_what_it_came_to),
        cmocka_unit_test(a_recorded_session_waits_for_its_page_and_not_for_others),
        cmocka_unit_test(a_page_is_rung_for_what_it_waits_for),
        cmocka_unit_test(a_page_that_asks_for_meshes_without_end_waits),
    };
    return cmocka_run_group_tests_name("live", tests, hall_make, hall_remove);
}
