// Who may see and command what by a page, and that nobody takes all places.
#include "test.h"
#include "unit/live_page.h"

#include <stdio.h>
#include <string.h>

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

static bool otto_is_blind_to_anna(void *user,
                                  void (*take)(void *taker, const char *account, const char *trainee),
                                  void *taker) {
    (void)user;
    take(taker, "otto", "anna");
    return true;
}

static void assign(struct page *page, const char *name) {
    arthron_Page message = {.which_message = arthron_Page_command_tag};
    message.message.command =
        (arthron_Command){.kind = arthron_Command_Kind_ASSIGN, .station = "room-1"};
    snprintf(message.message.command.trainee, 64, "%s", name);
    say(page, &message);
    command(page, arthron_Command_Kind_STOP, "");
    command(page, arthron_Command_Kind_START, "");
    draw_until(page, &page->replies, 3);
    assert_true(page->reply.ok);
}

static void a_rater_does_not_learn_whose_exam_goes_on(void **state) {
    (void)state;
    struct sessions *sessions = hall_open();
    struct live_config config = {.each_blind = otto_is_blind_to_anna};
    struct live_server *live = live_server_create(sessions, &config);
    struct live_account other = {.name = "grace", .role = "instructor"};
    struct page rater, examiner, wall;
    hall_join(sessions);
    open_page(&rater, live, &instructor);
    open_page(&examiner, live, &other);
    open_page(&wall, live, &instructor);
    assign(&examiner, "anna");
    watch(&rater, arthron_Watch_What_STATION, "room-1", 60);
    watch(&examiner, arthron_Watch_What_STATION, "room-1", 60);
    watch(&wall, arthron_Watch_What_WALL, "", 60);
    draw_until(&rater, &rater.sessions, 1);
    draw_until(&rater, &rater.places, 1);
    draw_until(&wall, &wall.places, 1);
    draw_until(&examiner, &examiner.sessions, 1);
    assert_string_equal(examiner.session.trainee, "anna");
    assert_string_equal(rater.session.trainee, "");
    assert_string_equal(rater.place.trainee, "");
    assert_string_equal(wall.place.trainee, "");
    assert_string_equal(wall.place.info.trainee, "");
    assert_string_equal(wall.place.info.next_trainee, "");
    command(&rater, arthron_Command_Kind_LIST, "");
    draw_until(&rater, &rater.replies, 1);
    assert_string_equal(rater.reply.sessions[0].trainee, "");
    assert_string_equal(rater.reply.sessions[0].next_trainee, "");
    command(&examiner, arthron_Command_Kind_LIST, "");
    draw_until(&examiner, &examiner.replies, 4);
    assert_string_equal(examiner.reply.sessions[0].trainee, "anna");
    close_page(&rater);
    close_page(&examiner);
    close_page(&wall);
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
        assert_non_null(live_server_join(live, i % 2 ? &by_code : &by_account, ""));
    assert_null(live_server_join(live, &by_code, ""));
    assert_null(live_server_join(live, &by_account, ""));
    int joined = LIVE_VIEWERS_OF_TRAINEE;
    for (int number = 0; number < LIVE_VIEWERS_MAX; number++) {
        struct live_account account = trainee_number(number);
        joined += live_server_join(live, &account, "") != NULL;
    }
    assert_int_equal(joined, LIVE_VIEWERS_OF_TRAINEES);
    joined = 0;
    while (live_server_join(live, &instructor, ""))
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
        assert_non_null(last = live_server_join(live, &instructor, ""));
    assert_null(live_server_join(live, &instructor, ""));
    assert_non_null(live_server_join(live, &technician, ""));
    live_server_leave(live, last);
    assert_non_null(live_server_join(live, &instructor, ""));
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

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(commands_are_answered_in_order_by_role),
        cmocka_unit_test(a_command_that_waits_holds_up_no_other_page),
        cmocka_unit_test(a_page_gets_no_answers_of_the_page_before_it),
        cmocka_unit_test(a_command_behind_too_many_others_is_refused),
        cmocka_unit_test(trainees_see_their_own_sessions_only),
        cmocka_unit_test(a_rater_does_not_learn_whose_exam_goes_on),
        cmocka_unit_test(nobody_takes_all_places),
        cmocka_unit_test(an_instructors_pages_leave_places_for_others),
        cmocka_unit_test(who_may_not_see_a_session_takes_no_place_for_its_meshes),
        cmocka_unit_test(a_trainee_is_told_the_same_of_anothers_station_and_of_none),
    };
    return cmocka_run_group_tests_name("live_people", tests, hall_make, hall_remove);
}
