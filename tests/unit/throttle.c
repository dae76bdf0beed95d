// How often somebody may be wrong, on a clock of the test's own; and secrets.
#include "api/throttle.h"

#include "api/secret.h"
#include "base/clock.h"
#include "test.h"

#include <ctype.h>
#include <stdio.h>
#include <string.h>

static struct throttle throttle;

static int begin(void **state) {
    (void)state;
    throttle = (struct throttle){.lock = PTHREAD_MUTEX_INITIALIZER};
    return 0;
}

static bool tries(const char *who, double s) {
    int wait_s;
    bool may = throttle_try(&throttle, who, 5, 1 + (int64_t)(s * NS_PER_S), &wait_s);
    assert_true(may ? wait_s == 0 : wait_s >= 1 && wait_s <= 60);
    return may;
}

static void five_wrong_in_a_minute_are_enough(void **state) {
    (void)state;
    int wait_s;
    for (int i = 0; i < 5; i++)
        assert_true(tries("ada", i));
    for (double s = 5; s < 59; s += 7)
        assert_false(tries("ada", s));
    assert_true(tries("eve", 10));
    assert_false(throttle_try(&throttle, "ada", 5, 50 * NS_PER_S, &wait_s));
    assert_in_range(wait_s, 10, 11);
    assert_true(tries("ada", 60.5));
    assert_false(tries("ada", 60.7)); // that of the second 1 still counts
    assert_true(tries("ada", 61.5));
    for (int i = 0; i < 5; i++)
        assert_true(tries("ada", 200 + i));
    assert_false(tries("ada", 205));
}

static void of_a_name_thirty_are_enough(void **state) {
    (void)state;
    int wait_s;
    for (int i = 0; i < 30; i++)
        assert_true(throttle_try(&throttle, "name ada", 30, (i + 1) * NS_PER_S, &wait_s));
    assert_false(throttle_try(&throttle, "name ada", 30, 60 * NS_PER_S, &wait_s));
    assert_int_equal(wait_s, 1);
    assert_true(throttle_try(&throttle, "name ada", 30, 61 * NS_PER_S, &wait_s));
    assert_false(throttle_try(&throttle, "name ada", 30, 61 * NS_PER_S + 1, &wait_s));
}

// At any rate, in no window of a minute are there more than five.
static void no_rate_gets_more_than_five_through_in_any_minute(void **state) {
    (void)state;
    for (int rate = 1; rate < 40; rate += 3) {
        double let[4096];
        int count = 0;
        begin(NULL);
        for (int i = 0; i < 400; i++)
            if (tries("ada", (double)i * rate / 7))
                let[count++] = (double)i * rate / 7;
        for (int i = 5; i < count; i++)
            assert_true(let[i] - let[i - 5] >= 60 - 1e-6);
        assert_true(count >= 5);
    }
}

static void tries_taken_back_do_not_count_and_others_stay(void **state) {
    (void)state;
    for (int i = 0; i < 100; i++) {
        assert_true(tries("ada", 1 + i * 0.1));
        throttle_take_back(&throttle, "ada", 1 + (int64_t)((1 + i * 0.1) * NS_PER_S));
    }
    for (int i = 0; i < 4; i++)
        assert_true(tries("ada", 20 + i));
    assert_true(tries("ada", 25));
    throttle_take_back(&throttle, "ada", 1 + 25 * NS_PER_S);
    assert_true(tries("ada", 26));
    assert_false(tries("ada", 27));
    throttle_take_back(&throttle, "nobody", 1);
    assert_false(tries("ada", 28));
}

static void it_knows_a_few_thousand_at_a_time(void **state) {
    (void)state;
    char who[32];
    for (int i = 0; i < 5; i++)
        assert_true(tries("ada", i));
    for (int i = 1; i < THROTTLE_KEYS; i++) {
        snprintf(who, sizeof who, "%d", i);
        assert_true(tries(who, 5 + i * 1e-4));
    }
    assert_false(tries("ada", 6));
    for (int i = THROTTLE_KEYS; i < 3 * THROTTLE_KEYS; i++) { // the oldest makes room
        snprintf(who, sizeof who, "%d", i);
        assert_true(tries(who, 6 + i * 1e-4));
    }
    assert_true(tries("ada", 9));
}

static void an_address_of_ipv6_counts_with_its_network(void **state) {
    (void)state;
    static const struct {
        const char *a, *b;
        bool same;
    } rows[] = {{"10.0.0.5", "10.0.0.5", true},
                {"10.0.0.5", "10.0.0.6", false},
                {"10.0.0.5", "::ffff:10.0.0.5", true},
                {"::ffff:10.0.0.5", "::ffff:10.0.0.6", false},
                {"2001:db8::1", "2001:db8::ffff:1:2:3", true},
                {"2001:db8::1", "2001:db8:0:1::1", false},
                {"", "10.0.0.5", false}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char a[64], b[64];
        throttle_address(rows[i].a, a);
        throttle_address(rows[i].b, b);
        assert_int_equal(!strcmp(a, b), rows[i].same);
    }
}

// ---- secrets ------------------------------------------------------------------------------------

static void secrets_differ_and_only_their_hash_is_theirs(void **state) {
    (void)state;
    char a[SECRET_MAX], b[SECRET_MAX], hash[SECRET_MAX];
    secret_make(a);
    secret_make(b);
    assert_int_equal(strlen(a), 64);
    assert_string_not_equal(a, b);
    assert_true(secret_is(a, a));
    assert_false(secret_is(a, b));
    assert_false(secret_is(a, ""));
    secret_hash("abc", hash); // FIPS 180-2, B.1
    assert_string_equal(hash, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

static void a_code_is_read_as_people_type_it(void **state) {
    (void)state;
    char code[SECRET_CODE_MAX], typed[32], read[SECRET_CODE_MAX];
    for (int i = 0; i < 200; i++) {
        secret_make_code(code);
        assert_int_equal(strlen(code), 8);
        assert_null(strpbrk(code, "0O1I"));
        snprintf(typed, sizeof typed, " %.4s-%s ", code, code + 4);
        for (char *c = typed; *c; c++)
            *c = (char)tolower((unsigned char)*c);
        assert_true(secret_read_code(typed, read));
        assert_string_equal(read, code);
    }
    static const char *const none[] = {"",         "ABCDEFG", "ABCDEFGHJ", "ABCDEFG0",
                                       "ABCDEFGI", "ÄBCDEFG", "ABCD EFG\n"};
    for (size_t i = 0; i < sizeof none / sizeof *none; i++)
        assert_false(secret_read_code(none[i], read));
}

int main(void) {
    const struct CMUnitTest tests[] = {
#define TEST(f) cmocka_unit_test_setup(f, begin)
        TEST(five_wrong_in_a_minute_are_enough),
        TEST(of_a_name_thirty_are_enough),
        TEST(no_rate_gets_more_than_five_through_in_any_minute),
        TEST(tries_taken_back_do_not_count_and_others_stay),
        TEST(it_knows_a_few_thousand_at_a_time),
        TEST(an_address_of_ipv6_counts_with_its_network),
        TEST(secrets_differ_and_only_their_hash_is_theirs),
        TEST(a_code_is_read_as_people_type_it),
    };
    return cmocka_run_group_tests_name("throttle", tests, NULL, NULL);
}
