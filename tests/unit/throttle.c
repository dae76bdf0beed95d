// How often somebody may be wrong, on a clock of the test's own; and secrets.
#include "api/throttle.h"

#include "api/device.h"
#include "api/secret.h"
#include "api/tally.h"
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

static const struct throttle_rule rule = {.free = 5, .first_s = 5, .most_s = 300};

static bool tries(const char *who, double s) {
    int wait_s;
    bool may = throttle_try(&throttle, who, &rule, (int64_t)(s * NS_PER_S), &wait_s);
    assert_true(may ? wait_s == 0 : wait_s >= 1 && wait_s <= 300);
    return may;
}

// 5 s, 10 s, 20 s ... 300 s.
static void behind_the_free_ones_each_wait_is_twice_as_long(void **state) {
    (void)state;
    double s = 100;
    int wait_s;
    for (int i = 0; i < 5; i++)
        assert_true(tries("ada", s));
    for (double wait = 5; s < 5000; wait = wait < 300 ? 2 * wait : 300) {
        double most = wait < 300 ? wait : 300;
        assert_false(tries("ada", s + most - 0.1));
        assert_false(
            throttle_may(&throttle, "ada", &rule, (int64_t)((s + 0.5) * NS_PER_S), &wait_s));
        assert_int_equal(wait_s, (int)most);
        assert_true(tries("eve", s + 1000));
        throttle_take_back(&throttle, "eve", (int64_t)((s + 1000) * NS_PER_S));
        s += most;
        assert_true(tries("ada", s));
    }
}

static void quiet_makes_it_forget(void **state) {
    (void)state;
    for (int i = 0; i < 5; i++)
        assert_true(tries("ada", 1));
    assert_true(tries("ada", 590));
    assert_false(tries("ada", 591)); // nothing was forgotten
    assert_true(tries("ada", 1190));
    for (int i = 0; i < 4; i++)
        assert_true(tries("ada", 1190));
    assert_false(tries("ada", 1190));
}

// However fast somebody asks: 5 free ones and 9 that waited in a quarter of an hour.
static void no_rate_gets_many_through(void **state) {
    (void)state;
    for (int rate = 1; rate < 40; rate += 3) {
        int count = 0;
        begin(NULL);
        for (double s = 0; s < 900; s += (double)rate / 7)
            count += tries("ada", s + 1);
        assert_in_range(count, 5, 13);
    }
}

static void to_ask_does_not_count(void **state) {
    (void)state;
    int wait_s;
    for (int i = 0; i < 100; i++)
        assert_true(throttle_may(&throttle, "ada", &rule, NS_PER_S, &wait_s));
    for (int i = 0; i < 5; i++)
        assert_true(tries("ada", 1));
    assert_false(throttle_may(&throttle, "ada", &rule, NS_PER_S, &wait_s));
    assert_int_equal(wait_s, 5);
}

static void take_back(const char *who, double s) {
    throttle_take_back(&throttle, who, (int64_t)(s * NS_PER_S));
}

static void tries_taken_back_do_not_count_and_others_stay(void **state) {
    (void)state;
    for (int i = 0; i < 100; i++) {
        assert_true(tries("ada", 1 + i * 0.1));
        take_back("ada", 1 + i * 0.1);
    }
    for (int i = 0; i < 4; i++)
        assert_true(tries("ada", 20));
    assert_true(tries("ada", 20));
    take_back("ada", 20);
    assert_true(tries("ada", 20));
    assert_false(tries("ada", 21));
    take_back("nobody", 21);
    assert_false(tries("ada", 21));
    assert_true(tries("ada", 25));
    take_back("ada", 25); // and nobody waits the longer for it
    assert_true(tries("ada", 25.5));
}

// Somebody with many addresses does not make it forget whom they guess at.
static void many_who_tried_once_do_not_push_out_one_who_waits(void **state) {
    (void)state;
    char who[32];
    for (int i = 0; i < 5; i++)
        assert_true(tries("ada", 1));
    for (int i = 1; i < 2 * THROTTLE_KEYS; i++) {
        snprintf(who, sizeof who, "%d", i);
        assert_true(tries(who, 1 + i * 1e-5));
    }
    assert_false(tries("ada", 2));
}

static void an_address_of_ipv6_counts_with_its_network(void **state) {
    (void)state;
    static const struct {
        const char *a, *b;
        bool same, near;
    } rows[] = {{"10.0.0.5", "10.0.0.5", true},
                {"10.0.0.5", "10.0.0.6", false},
                {"10.0.0.5", "::ffff:10.0.0.5", true},
                {"::ffff:10.0.0.5", "::ffff:10.0.0.6", false},
                {"2001:db8::1", "2001:db8::ffff:1:2:3", true},
                {"2001:db8::1", "2001:db8:0:1::1", false},
                {"2001:db8::1", "2001:db8::2", false, true},
                {"2001:db8::1", "2001:db8::1", true, true},
                {"", "10.0.0.5", false}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char a[64], b[64];
        throttle_address(rows[i].a, rows[i].near, a);
        throttle_address(rows[i].b, rows[i].near, b);
        assert_int_equal(!strcmp(a, b), rows[i].same);
    }
}

// ---- what is told -------------------------------------------------------------------------------

static void what_is_told_of_many_is_little(void **state) {
    (void)state;
    static struct tally tally = {.lock = PTHREAD_MUTEX_INITIALIZER};
    int told = 0;
    for (int i = 0; i < 1000; i++)
        told += tally_is_told(tally_add(&tally, "ada", NS_PER_S + i));
    assert_int_equal(told, 10); // 1, 2, 4 ... 512
    assert_int_equal(tally_add(&tally, "eve", NS_PER_S), 1);
    assert_int_equal(tally_add(&tally, "ada", 3600 * NS_PER_S), 1001);
    assert_int_equal(tally_add(&tally, "ada", 3601 * NS_PER_S), 1);
}

// ---- devices ------------------------------------------------------------------------------------

static void a_device_is_known_for_its_person_alone(void **state) {
    (void)state;
    const struct secret_key key = {{1}}, other = {{2}};
    const int64_t day_ns = 86400 * NS_PER_S, now_ns = 20000 * day_ns;
    char device[DEVICE_MAX], changed[DEVICE_MAX], id[DEVICE_ID_MAX], again[DEVICE_MAX];
    device_make(&key, "grace", now_ns, device);
    device_make(&key, "grace", now_ns, again);
    assert_string_not_equal(device, again);
    assert_true(device_is_known(&key, device, "grace", now_ns, id));
    assert_true(device_is_known(&key, device, "grace", now_ns + 89 * day_ns, id));
    assert_false(device_is_known(&key, device, "grace", now_ns + 90 * day_ns, id));
    assert_false(device_is_known(&key, device, "grac", now_ns, id));
    assert_false(device_is_known(&key, device, "", now_ns, id));
    assert_false(device_is_known(&other, device, "grace", now_ns, id));
    assert_false(device_is_known(&key, NULL, "grace", now_ns, id));
    for (size_t i = 0; i < strlen(device); i++) {
        memcpy(changed, device, sizeof changed);
        changed[i] = changed[i] == '0' ? '1' : '0';
        assert_false(device_is_known(&key, changed, "grace", now_ns, id));
    }
    device[DEVICE_MAX - 2] = '\0';
    assert_false(device_is_known(&key, device, "grace", now_ns, id));
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

static void a_keyed_hash_needs_its_key(void **state) {
    (void)state;
    struct secret_key key = {{0}};
    char hash[SECRET_MAX], again[SECRET_MAX], plain[SECRET_MAX];
    secret_keyed_hash(&key, "code", "ABCDEFGH", hash);
    // printf 'code\nABCDEFGH' | openssl dgst -sha256 -mac HMAC -macopt hexkey:00...00
    assert_string_equal(hash, "c526e2ff185ad1b65ae3e1fd81185f5b5ceb6dc24db6be39251cefa10a2bf200");
    secret_keyed_hash(&key, "device", "ABCDEFGH", again);
    assert_string_not_equal(hash, again);
    key.bytes[31] = 1;
    secret_keyed_hash(&key, "code", "ABCDEFGH", again);
    assert_string_not_equal(hash, again);
    secret_hash("ABCDEFGH", plain);
    assert_string_not_equal(hash, plain);
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
        TEST(behind_the_free_ones_each_wait_is_twice_as_long),
        TEST(quiet_makes_it_forget),
        TEST(no_rate_gets_many_through),
        TEST(to_ask_does_not_count),
        TEST(tries_taken_back_do_not_count_and_others_stay),
        TEST(many_who_tried_once_do_not_push_out_one_who_waits),
        TEST(what_is_told_of_many_is_little),
        TEST(a_device_is_known_for_its_person_alone),
        TEST(a_keyed_hash_needs_its_key),
        TEST(an_address_of_ipv6_counts_with_its_network),
        TEST(secrets_differ_and_only_their_hash_is_theirs),
        TEST(a_code_is_read_as_people_type_it),
    };
    return cmocka_run_group_tests_name("throttle", tests, NULL, NULL);
}
