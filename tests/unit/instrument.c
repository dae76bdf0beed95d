// Descriptions of instruments: the usual ones, and what is refused.
#include "base/instrument.h"

#include "test.h"

#include <math.h>
#include <string.h>

static struct instrument named(enum instrument_kind kind, const char *name) {
    struct instrument one = instrument_of_kind(kind);
    strcpy(one.name, name);
    return one;
}

static void the_usual_ones_have_their_numbers_and_sizes(void **state) {
    (void)state;
    static const char *const names[] = {"probe", "punch", "shaver", "knife", "scope"};
    const struct instruments *usual = instruments_usual();
    assert_int_equal(usual->count, 5);
    for (int i = 0; i < 5; i++) {
        const struct instrument *one = &usual->of[i];
        struct instruments a = {1, {*one}}, b = {1, {named(one->kind, names[i])}};
        assert_true(instruments_equal(&a, &b));
        assert_string_equal(channel_name((enum channel)(4 + i)), names[i]);
    }
    assert_true(!instrument_cuts(&usual->of[0]) && instrument_cuts(&usual->of[1]) &&
                instrument_cuts(&usual->of[2]) && instrument_cuts(&usual->of[3]) &&
                !instrument_cuts(&usual->of[4]));
}

static void a_grasper_does_not_cut(void **state) {
    (void)state;
    struct instruments tools = *instruments_usual();
    struct instrument grasper = named(INSTRUMENT_JAW, "grasper");
    struct instrument probe = named(INSTRUMENT_TIP, "probe-2");
    grasper.cuts = false;
    probe.cuts = true; // as a tip cannot
    assert_int_equal(instruments_add(&tools, &grasper, NULL), RESULT_OK);
    assert_int_equal(instruments_add(&tools, &probe, NULL), RESULT_OK);
    assert_false(instrument_cuts(&tools.of[5]));
    assert_false(instrument_cuts(&tools.of[6]));
}

static void a_button_closes_a_jaw(void **state) {
    (void)state;
    struct instrument jaw = instrument_of_kind(INSTRUMENT_JAW);
    struct handle handle = {0.4, 1u << 3};
    assert_true(instrument_opening(&jaw, &handle) == 0.4);
    jaw.button = 3;
    assert_true(instrument_opening(&jaw, &handle) == 0);
    handle.buttons = ~handle.buttons;
    assert_true(instrument_opening(&jaw, &handle) == 1);
}

static void assert_refused(struct instrument one, const char *word) {
    struct instruments tools = *instruments_usual();
    struct error err;
    assert_int_not_equal(instruments_add(&tools, &one, &err), RESULT_OK);
    if (!strstr(err.text, word))
        fail_msg("\"%s\" does not say \"%s\"", err.text, word);
    assert_int_equal(tools.count, INSTRUMENTS_USUAL);
}

static void a_bad_description_is_refused(void **state) {
    (void)state;
    static const char *const names[] = {"", "Upper", "2nd", "a b", "a/b", "\xff"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        assert_refused(named(INSTRUMENT_TIP, names[i]), "name is");
    assert_refused(named(INSTRUMENT_TIP, "probe"), "taken");
    assert_refused(named(INSTRUMENT_TIP, "femur"), "taken");
    assert_refused(named(INSTRUMENT_TIP, "instrument_7"), "taken");
    static const char *const of_others[] = {"probe_warped", "punch_handle", "virtual_femur",
                                            "mockup_probe", "torn_1"};
    for (size_t i = 0; i < sizeof of_others / sizeof *of_others; i++)
        assert_refused(named(INSTRUMENT_TIP, of_others[i]), "taken");
    struct instrument one = named(INSTRUMENT_JAW, "one");
    one.length_mm = NAN, assert_refused(one, "length_mm");
    one.length_mm = 31, assert_refused(one, "length_mm");
    one = named(INSTRUMENT_JAW, "one"), one.thickness_mm = 1,
    assert_refused(one, "nothing of a jaw");
    one = named(INSTRUMENT_JAW, "one"), one.button = 32, assert_refused(one, "button");
    one = named(INSTRUMENT_BURR, "one"), one.button = -1, assert_refused(one, "button");
    one = named(INSTRUMENT_TIP, "one"), one.button = 0, assert_refused(one, "button");
    one = named(INSTRUMENT_TIP, "one"), one.width_mm = NAN, assert_refused(one, "nothing of a tip");
    one = named(INSTRUMENT_TIP, "one"), one.colour = 0x1000000, assert_refused(one, "colour");
    one = named(INSTRUMENT_TIP, "one"), one.kind = (enum instrument_kind)99;
    assert_refused(one, "kind");
    memset(one.name, 'a', sizeof one.name); // without an end
    assert_refused(one, "name is");
}

static void there_is_room_for_three(void **state) {
    (void)state;
    struct instruments tools = *instruments_usual();
    static const char *const names[] = {"a", "b", "c", "d"};
    for (int i = 0; i < 4; i++) {
        struct instrument one = named(INSTRUMENT_TIP, names[i]);
        assert_int_equal(instruments_add(&tools, &one, NULL), i < 3 ? RESULT_OK : RESULT_LIMIT);
    }
    struct instruments warped = *instruments_usual();
    struct instrument longer = named(INSTRUMENT_TIP, "b_warped"), b = named(INSTRUMENT_TIP, "b");
    assert_int_equal(instruments_add(&warped, &longer, NULL), RESULT_OK);
    assert_int_equal(instruments_add(&warped, &b, NULL), RESULT_INVALID);
    struct instrument second = named(INSTRUMENT_TIP, "probe_2");
    assert_int_equal(instruments_add(&warped, &second, NULL), RESULT_OK);
    struct instrument again = named(INSTRUMENT_TIP, "a");
    struct instruments one = *instruments_usual();
    assert_int_equal(instruments_add(&one, &again, NULL), RESULT_OK);
    assert_int_equal(instruments_add(&one, &again, NULL), RESULT_INVALID);
    assert_false(instruments_equal(&one, &tools));
}

// Last: the names stay.
static void channels_take_the_names_of_described_ones(void **state) {
    (void)state;
    struct instruments tools = *instruments_usual();
    struct instrument curette = named(INSTRUMENT_BLADE, "curette");
    enum channel channel;
    assert_int_equal(instruments_add(&tools, &curette, NULL), RESULT_OK);
    assert_string_equal(channel_name(CHANNEL_FIRST_DESCRIBED), "instrument_6");
    instruments_name_channels(&tools);
    assert_string_equal(channel_name(CHANNEL_FIRST_DESCRIBED), "curette");
    assert_true(channel_from_name("curette", &channel) && channel == CHANNEL_FIRST_DESCRIBED);
    assert_false(channel_from_name("instrument_6", &channel));
    assert_true(channel_is_reserved("instrument_6") && !channel_is_reserved("curette"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_usual_ones_have_their_numbers_and_sizes),
        cmocka_unit_test(a_grasper_does_not_cut),
        cmocka_unit_test(a_button_closes_a_jaw),
        cmocka_unit_test(a_bad_description_is_refused),
        cmocka_unit_test(there_is_room_for_three),
        cmocka_unit_test(channels_take_the_names_of_described_ones),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
