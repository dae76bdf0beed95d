// What pages are told that look on: of the newest, no more than they take, and all of it in the
// end.
#include "live/live.h"

#include "base/clock.h"
#include "runtime/tissue_delta.h"
#include "test.h"
#include "unit/hall.h"

#include <pb_decode.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const struct live_account instructor = {.name = "otto", .role = "instructor"};
static const struct live_account technician = {.name = "tina", .role = "technician"};
static const struct live_account trainee = {.name = "anna", .role = "trainee", .trainee = "anna"};

// ---- a page -------------------------------------------------------------------------------------

struct page {
    struct live_server *live;
    struct viewer *viewer;
    bool meshes; // asks for them, and acknowledges
    int batches, moments, places, sessions, resections, remarks, replies, metrics, troubles;
    int progresses, beats;
    arthron_Trouble_Kind trouble_kind; // of the last
    bool done;
    uint64_t last_step;
    bool fell; // a step or a time did
    int64_t last_ns;
    arthron_LiveSession session;
    arthron_Resection resection; // the last
    arthron_Place place;         // the last
    arthron_Remark remark;       // the last
    arthron_CommandReply reply;  // the last
    char trouble[256];           // the last
    double time_s;               // that the session ran, by the last metrics
    struct tissue tissue;
    uint8_t *payload;
    size_t payload_size;
    int payloads;
};

static void open_page(struct page *page, struct live_server *live,
                      const struct live_account *account) {
    *page = (struct page){.live = live, .viewer = live_server_join(live, account)};
    assert_non_null(page->viewer);
}

static void close_page(struct page *page) {
    live_server_leave(page->live, page->viewer);
    tissue_fini(&page->tissue);
    free(page->payload);
}

static void say(struct page *page, const arthron_Page *message) {
    assert_true(live_server_take(page->live, page->viewer, message));
}

static void watch(struct page *page, arthron_Watch_What what, const char *name, uint32_t rate_hz) {
    arthron_Page message = {.which_message = arthron_Page_watch_tag};
    arthron_Watch *w = &message.message.watch;
    w->what = what;
    w->rate_hz = rate_hz;
    w->meshes = page->meshes = true;
    snprintf(what == arthron_Watch_What_RECORDED ? w->session : w->station, 33, "%s", name);
    say(page, &message);
}

static void ask_for_meshes(struct page *page) {
    arthron_Page message = {.which_message = arthron_Page_mesh_ask_tag};
    say(page, &message);
}

static void acknowledge(struct page *page, const char *group) {
    arthron_Page message = {.which_message = arthron_Page_mesh_ack_tag};
    arthron_MeshState *ack = &message.message.mesh_ack;
    snprintf(ack->group, sizeof ack->group, "%s", group);
    ack->number = page->tissue.number;
    ack->hash = page->tissue.hash;
    say(page, &message);
}

static void take_chunk(struct page *page, pb_istream_t *stream) {
    static arthron_MeshChunk chunk;
    struct error err = {""};
    pb_istream_t inner;
    assert_true(pb_make_string_substream(stream, &inner));
    assert_true(pb_decode(&inner, arthron_MeshChunk_fields, &chunk));
    pb_close_string_substream(stream, &inner);
    if (chunk.index == 0)
        page->payload_size = 0;
    assert_int_equal(page->payload_size, chunk.index * WIRE_CHUNK_DATA);
    page->payload = realloc(page->payload, chunk.size);
    memcpy(page->payload + page->payload_size, chunk.data.bytes, chunk.data.size);
    page->payload_size += chunk.data.size;
    if (page->payload_size < chunk.size)
        return;
    assert_int_equal(tissue_payload_hash(page->payload, chunk.size), chunk.hash);
    if (chunk.base == 0)
        tissue_fini(&page->tissue);
    if (tissue_apply(&page->tissue, page->payload, chunk.size, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    assert_int_equal(page->tissue.number, chunk.number);
    page->payloads++;
    if (!page->session.recorded)
        acknowledge(page, chunk.group);
}

static void take_moment(struct page *page, const arthron_Moment *moment) {
    page->moments++;
    page->fell |= moment->step <= page->last_step || moment->time_ns < page->last_ns;
    page->last_step = moment->step;
    page->last_ns = moment->time_ns;
}

static void take_session(struct page *page, const arthron_LiveSession *session) {
    static const uint8_t none[16];
    page->sessions++;
    page->session = *session;
    page->last_step = 0;
    page->last_ns = 0;
    if (page->meshes && !session->recorded && memcmp(session->id, none, sizeof none))
        ask_for_meshes(page);
}

static double value_of(const arthron_Metrics *metrics, const char *name) {
    for (int i = 0; i < metrics->metrics_count; i++)
        if (!strcmp(metrics->metrics[i].name, name))
            return metrics->metrics[i].value;
    fail_msg("there is no %s", name);
    return 0;
}

static void take_item(struct page *page, const arthron_Live *item) {
    switch (item->which_message) {
    case arthron_Live_place_tag:
        page->places++;
        page->place = item->message.place;
        break;
    case arthron_Live_session_tag:
        take_session(page, &item->message.session);
        break;
    case arthron_Live_moment_tag:
        take_moment(page, &item->message.moment);
        break;
    case arthron_Live_resection_tag:
        page->resections++;
        page->resection = item->message.resection;
        break;
    case arthron_Live_remark_tag:
        page->remarks++;
        page->remark = item->message.remark;
        break;
    case arthron_Live_metrics_tag:
        page->metrics++;
        page->time_s = value_of(&item->message.metrics, "time");
        break;
    case arthron_Live_command_reply_tag:
        page->replies++;
        page->reply = item->message.command_reply;
        break;
    case arthron_Live_progress_tag:
        page->progresses++;
        page->done |= item->message.progress.done;
        break;
    case arthron_Live_beat_tag:
        page->beats++;
        break;
    default:
        assert_int_equal(item->which_message, arthron_Live_trouble_tag);
        page->troubles++;
        page->trouble_kind = item->message.trouble.kind;
        snprintf(page->trouble, sizeof page->trouble, "%s", item->message.trouble.text);
        break;
    }
}

static void read_batch(struct page *page, const uint8_t *bytes, size_t size) {
    static arthron_Live item;
    pb_istream_t stream = pb_istream_from_buffer(bytes, size);
    page->batches++;
    while (stream.bytes_left) {
        pb_istream_t inner, peek;
        pb_wire_type_t type;
        uint32_t tag;
        bool end;
        assert_true(pb_decode_tag(&stream, &type, &tag, &end));
        assert_int_equal(tag, 1);
        assert_true(pb_make_string_substream(&stream, &inner));
        peek = inner;
        assert_true(pb_decode_tag(&peek, &type, &tag, &end));
        if (tag == 5) {
            take_chunk(page, &peek);
            pb_read(&inner, NULL, inner.bytes_left);
        } else {
            assert_true(pb_decode(&inner, arthron_Live_fields, &item));
            take_item(page, &item);
        }
        assert_true(pb_close_string_substream(&stream, &inner));
    }
}

// One batch, where there is one now; what it was asked to wait for else.
static int64_t draw_at(struct page *page, int64_t now_ns) {
    static uint8_t bytes[LIVE_BATCH_MAX];
    int64_t next_ns = now_ns;
    size_t size =
        live_server_batch(page->live, page->viewer, now_ns, bytes, sizeof bytes, &next_ns);
    assert_true(size <= sizeof bytes);
    assert_true(size || next_ns > now_ns); // else nobody asks again
    read_batch(page, bytes, size);
    if (size == 0)
        page->batches--;
    return next_ns;
}

static int64_t draw(struct page *page) {
    return draw_at(page, clock_now_ns());
}

// Draws whatever there is for so long.
static void draw_for(struct page *page, long ms) {
    int64_t end_ns = clock_now_ns() + ms * NS_PER_MS;
    while (clock_now_ns() < end_ns)
        if (draw(page) > clock_now_ns())
            hall_wait_ms(1);
}

static void draw_until(struct page *page, const int *count, int least) {
    for (int i = 0; i < 10000 && *count < least; i++)
        if (draw(page) > clock_now_ns())
            hall_wait_ms(1);
    assert_true(*count >= least);
}

static void draw_until_shown(struct page *page, const struct tissue_report *report) {
    const struct tissue_figures *figures = &report->figures[0];
    for (int i = 0; i < 10000 && (page->tissue.number < figures->mesh_number ||
                                  page->resection.cuts < figures->cuts);
         i++)
        if (draw(page) > clock_now_ns())
            hall_wait_ms(1);
}

// ---- a live server
// --------------------------------------------------------------------------------

static bool allow(void *user, const struct live_account *account, const char *session) {
    (void)user, (void)session;
    return !strcmp(account->role, "instructor");
}

static struct live_server *open_live(struct sessions *sessions) {
    struct live_config config = {.allowed = allow};
    return live_server_create(sessions, &config);
}

static void command(struct page *page, arthron_Command_Kind kind, const char *text) {
    arthron_Page message = {.which_message = arthron_Page_command_tag};
    message.message.command = (arthron_Command){.kind = kind, .station = "room-1"};
    message.message.command.has_remark = true;
    snprintf(message.message.command.remark.text, REMARK_TEXT_MAX, "%s", text);
    say(page, &message);
}

static void copy(struct page *page, const char *from) {
    arthron_Page message = {.which_message = arthron_Page_command_tag};
    message.message.command =
        (arthron_Command){.kind = arthron_Command_Kind_COPY, .station = "room-1"};
    snprintf(message.message.command.from, sizeof message.message.command.from, "%s", from);
    say(page, &message);
}

// ---- the tests ----------------------------------------------------------------------------------

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

static void commands_are_answered_in_order_by_role(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    struct live_server *live = open_live(sessions);
    struct page page, technicians, trainees;
    hall_join(sessions);
    open_page(&page, live, &instructor);
    open_page(&technicians, live, &technician);
    open_page(&trainees, live, &trainee);
    watch(&page, arthron_Watch_What_STATION, "room-1", 60);
    draw_until(&page, &page.sessions, 1);
    command(&page, arthron_Command_Kind_NOTE, "Slowly");
    command(&page, arthron_Command_Kind_PAUSE, "");
    draw_until(&page, &page.replies, 2);
    assert_true(page.reply.ok);
    assert_int_equal(page.reply.sessions[0].state, arthron_SessionState_PAUSED);
    draw_until(&page, &page.remarks, 1);
    assert_string_equal(page.remark.text, "Slowly");
    assert_string_equal(page.remark.author, "otto");
    command(&technicians, arthron_Command_Kind_LIST, "");
    draw_until(&technicians, &technicians.replies, 1);
    assert_true(technicians.reply.ok);
    command(&technicians, arthron_Command_Kind_START, "");
    draw_until(&technicians, &technicians.replies, 2);
    assert_false(technicians.reply.ok);
    command(&trainees, arthron_Command_Kind_LIST, "");
    draw_until(&trainees, &trainees.replies, 1);
    assert_false(trainees.reply.ok);
    copy(&page, "/etc/hostname");
    draw_until(&page, &page.replies, 3);
    assert_string_equal(page.reply.text, "a session is copied by its id");
    copy(&page, "00112233445566778899AABBCCDDEEFF");
    draw_until(&page, &page.replies, 4);
    assert_string_equal(page.reply.text, "a session is copied by its id");
    copy(&page, "00112233445566778899aabbccddeeff0");
    draw_until(&page, &page.replies, 5);
    assert_string_equal(page.reply.text, "a session is copied by its id");
    copy(&page, "00112233445566778899aabbccddeeff");
    draw_until(&page, &page.replies, 6);
    assert_non_null(strstr(page.reply.text, "no trace of a session 0011"));
    command(&page, arthron_Command_Kind_SHOW, "");
    draw_until(&page, &page.replies, 7);
    assert_int_equal(page.reply.sessions[0].state, arthron_SessionState_PAUSED);
    command(&page, arthron_Command_Kind_NOTE, "Sl\xf6wly"); // no UTF-8
    draw_until(&page, &page.replies, 8);
    assert_false(page.reply.ok);
    close_page(&page);
    close_page(&technicians);
    close_page(&trainees);
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

// A held command stands for an undo that takes long; a list waits for no command.
static void a_command_that_waits_holds_up_no_other_page(void **state) {
    (void)state;
    enum { PAGES = 9 };
    struct sessions *sessions = hall_open();
    struct live_server *live = open_live(sessions);
    struct page pages[PAGES];
    hall_join(sessions);
    for (int i = 0; i < PAGES; i++)
        open_page(&pages[i], live, &instructor);
    hall_hold_commands(sessions);
    command(&pages[0], arthron_Command_Kind_PAUSE, "");
    command(&pages[0], arthron_Command_Kind_LIST, ""); // in order
    for (int i = 1; i < PAGES; i++) {
        command(&pages[i], arthron_Command_Kind_LIST, "");
        draw_until(&pages[i], &pages[i].replies, 1);
    }
    draw(&pages[0]);
    assert_int_equal(pages[0].replies, 0);
    hall_let_commands_go(sessions);
    draw_until(&pages[0], &pages[0].replies, 2);
    assert_int_equal(pages[0].reply.sessions[0].state, arthron_SessionState_PAUSED);
    for (int i = 0; i < PAGES; i++)
        close_page(&pages[i]);
    live_server_destroy(&live);
    sessions_destroy(&sessions);
}

// While its command is under way the place goes from page to page.
static void a_page_gets_no_answers_of_the_page_before_it(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    struct live_server *live = open_live(sessions);
    struct page page;
    hall_join(sessions);
    open_page(&page, live, &instructor);
    hall_hold_commands(sessions);
    command(&page, arthron_Command_Kind_PAUSE, "");
    close_page(&page);
    hall_let_commands_go(sessions);
    while (hall_status(sessions).state != SESSION_PAUSED) {
        open_page(&page, live, &instructor);
        close_page(&page);
    }
    open_page(&page, live, &instructor);
    draw_for(&page, 50);
    assert_int_equal(page.replies, 0);
    close_page(&page);
    live_server_destroy(&live);
    sessions_destroy(&sessions);
}

// And answered in order: first those that found room.
static void a_command_behind_too_many_others_is_refused(void **state) {
    (void)state;
    enum { ROOM = 8, MORE = 40 };
    struct sessions *sessions = hall_open();
    struct live_server *live = open_live(sessions);
    struct page page;
    open_page(&page, live, &instructor);
    hall_hold_commands(sessions); // for which the first one waits
    command(&page, arthron_Command_Kind_NOTE, "");
    for (int i = 1; i < ROOM + MORE; i++)
        command(&page, arthron_Command_Kind_LIST, "");
    draw(&page);
    assert_int_equal(page.replies, 0);
    hall_let_commands_go(sessions);
    draw_until(&page, &page.replies, ROOM + MORE);
    assert_false(page.reply.ok);
    assert_non_null(strstr(page.reply.text, "commands of this page are waiting"));
    draw_for(&page, 50);
    assert_int_equal(page.replies, ROOM + MORE);
    command(&page, arthron_Command_Kind_LIST, "");
    draw_until(&page, &page.replies, ROOM + MORE + 1);
    assert_true(page.reply.ok);
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

static void trainees_see_their_own_sessions_only(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    struct live_server *live = open_live(sessions);
    struct page page, boss;
    hall_join(sessions);
    open_page(&boss, live, &instructor);
    open_page(&page, live, &trainee);
    watch(&page, arthron_Watch_What_WALL, "", 60);
    draw_for(&page, 50);
    assert_int_equal(page.places + page.moments, 0);
    assert_int_equal(page.troubles, 1);
    watch(&page, arthron_Watch_What_STATION, "room-1", 60);
    draw_for(&page, 100);
    assert_int_equal(page.troubles, 2);
    assert_int_equal(page.trouble_kind, arthron_Trouble_Kind_NOT_THERE);
    draw_until(&page, &page.beats, 2); // nothing comes, but the server is there
    assert_int_equal(page.troubles, 2);
    assert_int_equal(page.sessions + page.moments + page.places + page.resections, 0);
    arthron_Page message = {.which_message = arthron_Page_command_tag};
    message.message.command =
        (arthron_Command){.kind = arthron_Command_Kind_ASSIGN, .station = "room-1"};
    strcpy(message.message.command.trainee, "anna");
    say(&boss, &message);
    command(&boss, arthron_Command_Kind_STOP, "");
    command(&boss, arthron_Command_Kind_START, "");
    draw_until(&boss, &boss.replies, 3);
    assert_true(boss.reply.ok);
    draw_until(&page, &page.moments, 1);
    assert_string_equal(page.session.trainee, "anna");
    assert_int_equal(page.places, 0);
    close_page(&page);
    close_page(&boss);
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
        for (int i = 0; i < 10000 && !pages[k].done; i++)
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

static struct live_account trainee_number(int number) {
    struct live_account account = {.role = "trainee"};
    snprintf(account.name, sizeof account.name, "trainee %d", number);
    snprintf(account.trainee, sizeof account.trainee, "t%d", number);
    return account;
}

static void nobody_takes_all_places(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    struct live_server *live = open_live(sessions);
    struct live_account by_code = {.name = "anna", .role = "trainee", .trainee = "anna"},
                        by_account = {.name = "anna.a", .role = "trainee", .trainee = "anna"};
    for (int i = 0; i < LIVE_VIEWERS_OF_TRAINEE; i++)
        assert_non_null(live_server_join(live, i % 2 ? &by_code : &by_account));
    assert_null(live_server_join(live, &by_code));
    assert_null(live_server_join(live, &by_account));
    int joined = LIVE_VIEWERS_OF_TRAINEE;
    for (int number = 0; number < LIVE_VIEWERS_MAX; number++) {
        struct live_account account = trainee_number(number);
        joined += live_server_join(live, &account) != NULL;
    }
    assert_int_equal(joined, LIVE_VIEWERS_OF_TRAINEES);
    joined = 0;
    while (live_server_join(live, &instructor))
        joined++;
    assert_int_equal(joined, LIVE_VIEWERS_MAX - LIVE_VIEWERS_OF_TRAINEES);
    live_server_destroy(&live);
    sessions_destroy(&sessions);
}

static void an_instructors_pages_leave_places_for_others(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    struct live_server *live = open_live(sessions);
    struct viewer *last = NULL;
    for (int i = 0; i < LIVE_VIEWERS_OF_STAFF; i++)
        assert_non_null(last = live_server_join(live, &instructor));
    assert_null(live_server_join(live, &instructor));
    assert_non_null(live_server_join(live, &technician));
    live_server_leave(live, last);
    assert_non_null(live_server_join(live, &instructor));
    live_server_destroy(&live);
    sessions_destroy(&sessions);
}

// Sixteen pages have a place for the meshes of a station.
static void who_may_not_see_a_session_takes_no_place_for_its_meshes(void **state) {
    (void)state;
    enum { OTHERS = 20 };
    struct sessions *sessions = hall_open();
    struct live_server *live = open_live(sessions);
    static struct page others[OTHERS];
    struct page page;
    hall_join(sessions);
    for (int i = 0; i < OTHERS; i++) {
        struct live_account account = trainee_number(i);
        open_page(&others[i], live, &account);
        watch(&others[i], arthron_Watch_What_STATION, "room-1", 100);
        draw_until(&others[i], &others[i].troubles, 1);
        assert_int_equal(others[i].trouble_kind, arthron_Trouble_Kind_NOT_THERE);
    }
    hall_shave(sessions);
    struct tissue_report report = hall_last_tissues(sessions);
    open_page(&page, live, &instructor);
    watch(&page, arthron_Watch_What_STATION, "room-1", 100);
    draw_until_shown(&page, &report);
    assert_int_equal(page.troubles, 0);
    assert_int_equal(page.tissue.hash, report.mesh_hashes[0]);
    for (int i = 0; i < OTHERS; i++)
        close_page(&others[i]);
    close_page(&page);
    live_server_destroy(&live);
    hall_leave(sessions);
    sessions_destroy(&sessions);
}

static void a_trainee_is_told_the_same_of_anothers_station_and_of_none(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    struct live_server *live = open_live(sessions);
    static const char *const names[] = {"room-1", "room-x"};
    char told[2][256];
    hall_join(sessions);
    for (int i = 0; i < 2; i++) {
        struct live_account account = trainee_number(7);
        struct page page;
        open_page(&page, live, &account);
        watch(&page, arthron_Watch_What_STATION, names[i], 100);
        draw_until(&page, &page.troubles, 1);
        assert_int_equal(page.trouble_kind, arthron_Trouble_Kind_NOT_THERE);
        memcpy(told[i], page.trouble, sizeof told[i]);
        close_page(&page);
    }
    *strstr(told[1], "room-x") = '\0';
    *strstr(told[0], "room-1") = '\0';
    assert_string_equal(told[0], told[1]);
    live_server_destroy(&live);
    hall_leave(sessions);
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
    live_server_on_news(live, ring, NULL);
    open_page(&page, live, &instructor);
    command(&page, arthron_Command_Kind_LIST, "");
    for (int i = 0; i < 2000 && !atomic_load(&rung); i++)
        hall_wait_ms(1);
    assert_int_equal(atomic_load(&rung), 1);
    live_server_on_news(live, NULL, NULL);
    command(&page, arthron_Command_Kind_LIST, "");
    draw_until(&page, &page.replies, 2);
    assert_int_equal(atomic_load(&rung), 1);
    close_page(&page);
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
        cmocka_unit_test(commands_are_answered_in_order_by_role),
        cmocka_unit_test(a_page_that_looks_again_gets_all_remarks_again),
        cmocka_unit_test(a_command_that_waits_holds_up_no_other_page),
        cmocka_unit_test(a_page_gets_no_answers_of_the_page_before_it),
        cmocka_unit_test(a_command_behind_too_many_others_is_refused),
        cmocka_unit_test(metrics_are_of_the_session_that_is_shown),
        cmocka_unit_test(trainees_see_their_own_sessions_only),
        cmocka_unit_test(a_recorded_session_comes_to_what_it_came_to),
        cmocka_unit_test(a_recorded_session_waits_for_its_page_and_not_for_others),
        cmocka_unit_test(nobody_takes_all_places),
        cmocka_unit_test(an_instructors_pages_leave_places_for_others),
        cmocka_unit_test(who_may_not_see_a_session_takes_no_place_for_its_meshes),
        cmocka_unit_test(a_trainee_is_told_the_same_of_anothers_station_and_of_none),
        cmocka_unit_test(a_page_is_rung_for_what_it_waits_for),
    };
    return cmocka_run_group_tests_name("live", tests, hall_make, hall_remove);
}
