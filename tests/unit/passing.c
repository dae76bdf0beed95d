// What another server tells, on its way to a page: the numbers of its stations become those of this
// one, and answers are taken out.
#include "live/passing.h"

#include "random.h"
#include "test.h"

#include <pb_decode.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// ---- what another server tells ------------------------------------------------------------------

static struct {
    uint8_t batch[4 * LIVE_ITEM_MAX], out[PASSING_GROWTH * 4 * LIVE_ITEM_MAX];
    size_t size, out_size;
    int own[300];
    struct passing_numbers numbers;
    struct passing passing;
    uint32_t left_out; // of this kind nothing is wanted
    int wanted, replies;
    uint8_t reply[LIVE_ITEM_MAX];
    size_t reply_size;
    arthron_Live item; // too large for a stack
} now;

static int on_find(void *user, const char *station, int likely) {
    int number;
    (void)user, (void)likely;
    return sscanf(station, "room-%d", &number) == 1 ? number : -1;
}

static bool on_wanted(void *user, uint32_t kind, int station) {
    (void)user;
    now.wanted++;
    bool is_numbered = kind == arthron_Live_place_tag || kind == arthron_Live_moment_tag;
    return kind != now.left_out && (!is_numbered || station >= 0);
}

static void on_reply(void *user, const uint8_t *item, size_t size) {
    (void)user;
    now.replies++;
    memcpy(now.reply, item, size);
    now.reply_size = size;
}

static int begin(void **state) {
    (void)state;
    memset(&now, 0, sizeof now);
    for (int i = 0; i < 300; i++)
        now.own[i] = -1;
    now.numbers = (struct passing_numbers){300, now.own};
    now.passing = (struct passing){&now.numbers, NULL, on_find, on_wanted, on_reply, 0};
    return 0;
}

static void tell(void) {
    size_t used;
    assert_int_equal(
        live_encode(&now.item, now.batch + now.size, sizeof now.batch - now.size, &used),
        RESULT_OK);
    now.size += used;
}

static void tell_place(uint32_t number, const char *station) {
    now.item = (arthron_Live){.which_message = arthron_Live_place_tag};
    now.item.message.place.station_number = number;
    now.item.message.place.has_info = true;
    now.item.message.place.cuts = 7;
    snprintf(now.item.message.place.info.station, 64, "%s", station);
    tell();
}

static void tell_moment(uint32_t number, uint64_t step) {
    now.item = (arthron_Live){.which_message = arthron_Live_moment_tag};
    now.item.message.moment.station_number = number;
    now.item.message.moment.step = step;
    tell();
}

static void tell_list(const char *const *stations, const char *const *servers, int count) {
    now.item = (arthron_Live){.which_message = arthron_Live_command_reply_tag};
    arthron_CommandReply *reply = &now.item.message.command_reply;
    reply->ok = true;
    reply->certificate_until_utc_s = 4000000000;
    reply->sessions_count = (pb_size_t)count;
    for (int i = 0; i < count; i++) {
        snprintf(reply->sessions[i].station, 64, "%s", stations[i]);
        snprintf(reply->sessions[i].server, 128, "%s", servers[i]);
        reply->sessions[i].steps = servers[i][0] ? 0 : 100;
    }
    tell();
}

static void pass_on(void) {
    assert_true(passing_take(&now.passing, now.batch, now.size, now.out, &now.out_size));
    assert_true(now.out_size <= PASSING_GROWTH * now.size);
    now.size = 0;
}

// ---- what the page hears ------------------------------------------------------------------------

// The next item; NULL: there is none.
static const arthron_Live *next_item(const uint8_t *items, size_t size, size_t *at) {
    uint32_t kind, tag;
    pb_wire_type_t type;
    bool ended;
    size_t whole = passing_first(items + *at, size - *at, &kind);
    if (!whole)
        return NULL;
    pb_istream_t stream = pb_istream_from_buffer(items + *at, whole), inner;
    *at += whole;
    assert_true(pb_decode_tag(&stream, &type, &tag, &ended) && tag == 1);
    assert_true(pb_make_string_substream(&stream, &inner));
    assert_true(pb_decode(&inner, arthron_Live_fields, &now.item));
    assert_int_equal(now.item.which_message, kind);
    return &now.item;
}

static const arthron_Live *heard(size_t *at) {
    return next_item(now.out, now.out_size, at);
}

// ---- tests --------------------------------------------------------------------------------------

static void a_station_has_the_number_that_it_has_here(void **state) {
    (void)state;
    static const struct {
        uint32_t there;
        int here;
    } rows[] = {{0, 5}, {5, 0}, {1, 1}, {127, 299}, {299, 127}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char station[64];
        size_t at = 0;
        snprintf(station, sizeof station, "room-%d", rows[i].here);
        tell_place(rows[i].there, station);
        tell_moment(rows[i].there, 1000 + i);
        pass_on();
        const arthron_Live *item = heard(&at);
        assert_int_equal(item->message.place.station_number, rows[i].here);
        assert_int_equal(item->message.place.cuts, 7);
        assert_string_equal(item->message.place.info.station, station);
        item = heard(&at);
        assert_int_equal(item->message.moment.station_number, rows[i].here);
        assert_int_equal(item->message.moment.step, 1000 + i);
        assert_null(heard(&at));
    }
}

static void a_number_without_a_name_is_left_out(void **state) {
    (void)state;
    size_t at = 0;
    tell_moment(3, 1);             // not told yet
    tell_place(4, "of no config"); // not in the config here
    tell_moment(4, 2);
    tell_place(5000, "room-1"); // more than there can be
    pass_on();
    assert_null(heard(&at));
    tell_place(3, "room-2");
    tell_moment(3, 2);
    pass_on();
    assert_int_equal(heard(&at)->which_message, arthron_Live_place_tag);
    assert_int_equal(heard(&at)->message.moment.station_number, 2);
}

static void an_answer_goes_its_own_way_and_all_else_as_it_came(void **state) {
    (void)state;
    static const char *const stations[] = {"room-1"}, *const servers[] = {""};
    size_t at = 0, used;
    static arthron_MeshChunk chunk = {.group = "meniscus", .size = 9, .data = {.size = 9}};
    tell_list(stations, servers, 1);
    size_t answer = now.size;
    uint8_t told[1024];
    memcpy(told, now.batch, answer);
    now.item = (arthron_Live){.which_message = arthron_Live_trouble_tag};
    now.item.message.trouble.has_why = true;
    now.item.message.trouble.why.code = arthron_Why_Code_NOT_HERE;
    tell();
    assert_int_equal(live_encode_chunk(&chunk, now.batch + now.size, 1024, &used), RESULT_OK);
    now.size += used;
    size_t rest = now.size - answer;
    memcpy(told + answer, now.batch + answer, rest);
    pass_on();
    assert_int_equal(now.replies, 1);
    assert_int_equal(now.reply_size, answer);
    assert_memory_equal(now.reply, told, answer);
    assert_int_equal(now.passing.why, arthron_Why_Code_NOT_HERE);
    assert_int_equal(now.out_size, rest);
    assert_memory_equal(now.out, told + answer, rest);
    uint32_t kind;
    at = passing_first(now.out, now.out_size, &kind);
    assert_int_equal(kind, arthron_Live_trouble_tag);
    passing_first(now.out + at, now.out_size - at, &kind);
    assert_int_equal(kind, PASSING_CHUNK);
}

static void what_is_not_wanted_does_not_come(void **state) {
    (void)state;
    size_t at = 0;
    now.left_out = arthron_Live_moment_tag;
    tell_place(1, "room-1");
    tell_moment(1, 1);
    pass_on();
    assert_int_equal(heard(&at)->which_message, arthron_Live_place_tag);
    assert_null(heard(&at));
}

// What is damaged is left out or passed on, and never read beyond its end; what comes out is again
// a batch that stays as it is.
static void no_bytes_lead_astray(void **state) {
    (void)state;
    static uint8_t again[PASSING_GROWTH * sizeof now.out];
    struct random random = {7};
    for (int i = 0; i < 3000; i++) {
        begin(NULL);
        tell_place(2, "room-3");
        tell_moment(2, 77);
        for (int damages = 0; damages < 4; damages++)
            now.batch[random_bits(&random) % now.size] = (uint8_t)random_bits(&random);
        size_t size = now.size - random_bits(&random) % 3, again_size;
        uint8_t *exact = malloc(size); // so that a sanitizer sees its end
        memcpy(exact, now.batch, size);
        passing_take(&now.passing, exact, size, now.out, &now.out_size);
        free(exact);
        assert_true(now.out_size <= PASSING_GROWTH * size);
        for (int j = 0; j < 300; j++)
            now.own[j] = j;
        assert_true(passing_take(&now.passing, now.out, now.out_size, again, &again_size) ||
                    now.out_size == 0);
    }
}

static void a_list_has_the_rows_of_those_who_serve(void **state) {
    (void)state;
    static const char *const stations[] = {"room-1", "room-2", "room-3"};
    static const char *const mine[] = {"", "b:1", "c:1"}, *const theirs[] = {"a:1", "", ""};
    static uint8_t own[LIVE_ITEM_MAX], merged[LIVE_ITEM_MAX];
    tell_list(stations, mine, 3);
    size_t own_size = now.size, at = 0;
    memcpy(own, now.batch, own_size);
    now.size = 0;
    tell_list(stations, theirs, 2); // of the third it says nothing
    size_t size = passing_merge(own, own_size, now.batch, now.size, merged, sizeof merged);
    const arthron_CommandReply *reply = &next_item(merged, size, &at)->message.command_reply;
    assert_int_equal(at, size);
    assert_int_equal(reply->sessions_count, 3);
    assert_int_equal(reply->certificate_until_utc_s, 4000000000);
    static const char *const servers[] = {"", "b:1", "c:1"};
    static const uint64_t steps[] = {100, 100, 0};
    for (int i = 0; i < 3; i++) {
        assert_string_equal(reply->sessions[i].station, stations[i]);
        assert_string_equal(reply->sessions[i].server, servers[i]);
        assert_int_equal(reply->sessions[i].steps, steps[i]);
    }
    assert_int_equal(passing_merge(own, own_size, now.batch, now.size, merged, size - 1), 0);
    assert_int_equal(passing_merge(own, own_size, own, 1, merged, sizeof merged), 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_station_has_the_number_that_it_has_here, begin),
        cmocka_unit_test_setup(a_number_without_a_name_is_left_out, begin),
        cmocka_unit_test_setup(an_answer_goes_its_own_way_and_all_else_as_it_came, begin),
        cmocka_unit_test_setup(what_is_not_wanted_does_not_come, begin),
        cmocka_unit_test_setup(no_bytes_lead_astray, begin),
        cmocka_unit_test_setup(a_list_has_the_rows_of_those_who_serve, begin),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
