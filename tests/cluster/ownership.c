// Who serves a station: properties over simulated faults (lease_sim.h), and single courses.
#include "cluster/ownership.h"

#include "lease_sim.h"
#include "test.h"

#include <stdio.h>
#include <string.h>

#define SEEDS 60

// ---- over many faults ---------------------------------------------------------------------------

static struct lease_figures run(uint64_t seed, int servers) {
    struct lease_sim sim = {.seed = seed,
                            .servers = servers,
                            .stations = 6,
                            .fault_s = 3,
                            .trouble_s = 120,
                            .quiet_s = 60,
                            .drift = 0.01};
    return lease_sim_run(&sim);
}

static void no_two_servers_own_a_station_and_nothing_safe_is_lost_whatever_happens(void **state) {
    (void)state;
    uint64_t takes = 0, deposals = 0, lives_lost = 0, restored = 0;
    for (uint64_t seed = 1; seed <= SEEDS; seed++) {
        struct lease_figures figures = run(seed, 3 + (int)(seed % 4));
        assert_int_equal(figures.double_owners, 0);
        assert_int_equal(figures.sinking_tokens, 0);
        assert_int_equal(figures.lost, 0);
        assert_int_equal(figures.risen, 0);
        assert_int_equal(figures.torn, 0);
        restored += figures.restored;
        takes += figures.takes;
        deposals += figures.deposals;
        lives_lost += figures.lives_lost;
    }
    assert_true(takes > 10 * SEEDS && deposals > SEEDS && lives_lost > SEEDS &&
                restored > 5 * SEEDS); // it was put to the test
}

static void all_stations_are_served_once_all_is_well(void **state) {
    (void)state;
    for (uint64_t seed = 1; seed <= SEEDS; seed++) {
        struct lease_figures figures = run(seed, 3);
        assert_int_equal(figures.unserved, 0);
        assert_true(figures.longest_gap_s < 1);
    }
}

static void where_nothing_happens_nobody_loses_a_station(void **state) {
    (void)state;
    struct lease_sim sim = {.seed = 1, .servers = 5, .stations = 10, .quiet_s = 300, .drift = 0.01};
    struct lease_figures figures = lease_sim_run(&sim);
    assert_int_equal(figures.deposals, 0);
    assert_int_equal(figures.lives_lost, 0);
    assert_int_equal(figures.unserved, 0);
    assert_true(figures.writes <
                5 * 300 / 3 + 500); // a write each three seconds, and those of stations
}

// ---- single courses -----------------------------------------------------------------------------

static struct {
    struct key_write last;
    char server[SERVER_NAME_SIZE];
    int writes;
    enum station_owner owner;
    uint64_t lives;
} seen;

static void on_write(void *user, const struct key_write *write) {
    (void)user;
    seen.last = *write;
    snprintf(seen.server, sizeof seen.server, "%s", write->server ? write->server : "");
    seen.writes++;
}

static void on_changed(void *user, int station, enum station_owner owner) {
    (void)user, (void)station;
    seen.owner = owner;
}

static uint64_t on_new_life(void *user) {
    (void)user;
    return 100 + ++seen.lives;
}

static struct ownership *begin(uint64_t life_before) {
    const struct ownership_handler handler = {NULL, on_write, on_changed, on_new_life};
    memset(&seen, 0, sizeof seen);
    return ownership_create("a", &(struct server_value){0}, life_before, 1, &handler);
}

static struct ownership *begin_in(void) {
    struct ownership *o = begin(0);
    ownership_tick(o, 0);
    assert_string_equal(seen.server, "a");
    ownership_answered(o, seen.last.id, WRITE_DONE, 1, NS_PER_MS);
    assert_true(ownership_is_valid(o, NS_PER_MS));
    return o;
}

static void it_serves_until_ten_seconds_after_it_sent_its_last_good_write(void **state) {
    (void)state;
    struct ownership *o = begin(0);
    ownership_tick(o, 0);
    ownership_answered(o, seen.last.id, WRITE_DONE, 1, 5 * NS_PER_S);
    assert_true(ownership_is_valid(o, LEASE_VALID_NS - 1));
    assert_false(ownership_is_valid(o, LEASE_VALID_NS));
    ownership_destroy(&o);
}

static void a_living_server_keeps_its_station(void **state) {
    (void)state;
    struct ownership *o = begin_in();
    ownership_saw_server(o, "b", &(struct server_value){.life = 7}, 2, 0);
    ownership_saw_station(o, 0, &(struct station_value){.server = "b", .life = 7}, 3, 0);
    assert_int_equal(ownership_want(o, 0, NS_PER_S), OWNER_ELSEWHERE);
    assert_string_equal(ownership_named(o, 0), "b");
    ownership_destroy(&o);
}

static void it_tells_who_serves_and_what_it_cannot_know_stays_as_it_was(void **state) {
    (void)state;
    struct cluster_peer peer;
    const int64_t late_ns = LEASE_DEAD_NS + NS_PER_S;
    struct ownership *o = begin_in();
    assert_int_equal(ownership_served_by(o, 0, 0), SERVED_NOWHERE);
    ownership_saw_server(o, "b", &(struct server_value){.life = 7, .pages = "b:1"}, 2, 0);
    ownership_saw_station(o, 0, &(struct station_value){.server = "b", .life = 7}, 3, 0);
    assert_int_equal(ownership_served_by(o, 0, 0), 0);
    assert_true(ownership_peer(o, 0, 0, &peer));
    assert_string_equal(peer.name, "b");
    assert_string_equal(peer.pages, "b:1");
    assert_false(ownership_peer(o, 1, 0, &peer));
    assert_int_equal(ownership_served_by(o, 0, late_ns), 0); // nor were its own writes answered
    ownership_tick(o, late_ns);
    ownership_answered(o, seen.last.id, WRITE_DONE, 4, late_ns);
    assert_int_equal(ownership_served_by(o, 0, late_ns), SERVED_NOWHERE);
    ownership_saw_server(o, "b", &(struct server_value){.life = 8}, 5, late_ns);
    assert_int_equal(ownership_served_by(o, 0, late_ns), SERVED_NOWHERE); // of its life before
    ownership_want(o, 0, late_ns);
    ownership_answered(o, seen.last.id, WRITE_DONE, 6, late_ns);
    assert_int_equal(ownership_served_by(o, 0, late_ns), SERVED_HERE);
    ownership_destroy(&o);
}

static void a_dead_server_is_deposed_before_its_station_is_taken(void **state) {
    (void)state;
    struct ownership *o = begin_in();
    int64_t late_ns = LEASE_DEAD_NS + NS_PER_S;
    ownership_saw_server(o, "b", &(struct server_value){.life = 7}, 2, 0);
    ownership_saw_station(o, 0, &(struct station_value){.server = "b", .life = 7}, 3, 0);
    ownership_tick(o, late_ns);
    ownership_answered(o, seen.last.id, WRITE_DONE, 4, late_ns);
    assert_int_equal(ownership_want(o, 0, late_ns), OWNER_TAKING);
    assert_string_equal(seen.server, "b");
    assert_int_equal(seen.last.replaces, 2);
    assert_int_equal(seen.last.of_server.life, 0);
    ownership_answered(o, seen.last.id, WRITE_DONE, 5, late_ns);
    ownership_tick(o, late_ns + 1);
    assert_string_equal(seen.server, "");
    assert_int_equal(seen.last.replaces, 3);
    assert_string_equal(seen.last.of_station.server, "a");
    ownership_answered(o, seen.last.id, WRITE_DONE, 6, late_ns);
    assert_int_equal(seen.owner, OWNER_SELF);
    assert_int_equal(ownership_token(o, 0), 6);
    ownership_destroy(&o);
}

static void a_server_that_was_never_seen_is_deposed_before_its_station_is_taken(void **state) {
    (void)state;
    struct ownership *o = begin_in();
    int64_t seen_ns = 8 * NS_PER_S, late_ns = seen_ns + LEASE_DEAD_NS;
    ownership_saw_station(o, 0, &(struct station_value){.server = "b", .life = 7}, 3, seen_ns);
    assert_int_equal(ownership_want(o, 0, seen_ns), OWNER_ELSEWHERE);
    assert_null(ownership_other(o, 0, seen_ns)); // its address is not known
    ownership_tick(o, late_ns);
    ownership_answered(o, seen.last.id, WRITE_DONE, 4, late_ns);
    assert_int_equal(ownership_want(o, 0, late_ns), OWNER_TAKING);
    assert_string_equal(seen.server, "b");
    assert_int_equal(seen.last.replaces, 0); // fails where it has a key, so lives perhaps
    ownership_destroy(&o);
}

// Its key may be on the way in which it took the station.
static void a_server_whose_newest_life_is_not_seen_yet_keeps_its_station(void **state) {
    (void)state;
    struct ownership *o = begin_in();
    ownership_saw_server(o, "b", &(struct server_value){.life = 7}, 2, NS_PER_S);
    ownership_saw_station(o, 0, &(struct station_value){.server = "b", .life = 8}, 4, NS_PER_S);
    int writes = seen.writes;
    ownership_want(o, 0, 2 * NS_PER_S);
    assert_int_equal(seen.writes, writes);
    ownership_saw_server(o, "b", &(struct server_value){.life = 9}, 5, 2 * NS_PER_S);
    assert_int_equal(ownership_want(o, 0, 2 * NS_PER_S), OWNER_TAKING);
    assert_int_equal(seen.last.replaces, 4);
    assert_string_equal(seen.last.of_station.server, "a");
    ownership_destroy(&o);
}

static void servers_are_found_by_their_names_however_many_there_are(void **state) {
    (void)state;
    char name[SERVER_NAME_SIZE], address[SERVER_ADDRESS_SIZE];
    struct ownership *o = begin_in();
    for (int i = 0; i < 3000; i++) {
        struct server_value value = {.life = 1 + (uint64_t)i};
        snprintf(name, sizeof name, "server-%d", i);
        snprintf(value.stations, sizeof value.stations, "host-%d:4810", i);
        ownership_saw_server(o, name, &value, 10 + (uint64_t)i, 0);
    }
    for (int i = 0; i < 3000; i++) {
        struct station_value value = {.life = 1 + (uint64_t)i};
        snprintf(value.server, sizeof value.server, "server-%d", i);
        snprintf(address, sizeof address, "host-%d:4810", i);
        ownership_saw_station(o, 0, &value, 10000 + (uint64_t)i, 0);
        assert_string_equal(ownership_address(o, 0), address);
    }
    ownership_destroy(&o);
}

static void a_deposed_server_is_in_doubt_until_it_has_taken_its_station_again(void **state) {
    (void)state;
    for (int other = 0; other < 2; other++) {
        struct ownership *o = begin_in();
        ownership_want(o, 0, NS_PER_S);
        ownership_answered(o, seen.last.id, WRITE_DONE, 2, NS_PER_S);
        assert_int_equal(ownership_of(o, 0), OWNER_SELF);
        ownership_saw_server(o, "a", &(struct server_value){0}, 3, 2 * NS_PER_S);
        assert_int_equal(ownership_of(o, 0), OWNER_DOUBTFUL);
        assert_false(ownership_is_valid(o, 2 * NS_PER_S));
        ownership_tick(o, 3 * NS_PER_S);
        ownership_answered(o, seen.last.id, WRITE_DONE, 4, 3 * NS_PER_S);
        ownership_tick(o, 3 * NS_PER_S);
        assert_int_equal(seen.last.replaces, 2);
        ownership_answered(o, seen.last.id, other ? WRITE_LATE : WRITE_DONE, other ? 0 : 5,
                           3 * NS_PER_S);
        if (other)
            ownership_saw_station(o, 0, &(struct station_value){.server = "b", .life = 7}, 5,
                                  3 * NS_PER_S);
        assert_int_equal(ownership_of(o, 0), other ? OWNER_ELSEWHERE : OWNER_SELF);
        ownership_destroy(&o);
    }
}

static void a_take_that_lands_when_it_is_not_wanted_any_more_is_released(void **state) {
    (void)state;
    struct ownership *o = begin_in();
    ownership_want(o, 0, NS_PER_S);
    struct key_write take = seen.last;
    ownership_release(o, 0, NS_PER_S);
    ownership_saw_station(o, 0, &take.of_station, 2, NS_PER_S);
    assert_int_equal(ownership_of(o, 0), OWNER_NONE);
    ownership_tick(o, 4 * NS_PER_S - 1);
    assert_int_equal(seen.last.replaces, 2);
    assert_string_equal(seen.last.of_station.server, "");
    ownership_destroy(&o);
}

static void
a_server_stays_out_while_another_of_its_name_lives_but_not_for_the_one_before(void **state) {
    (void)state;
    for (int own = 0; own < 2; own++) {
        struct ownership *o = begin(own ? 7 : 0);
        ownership_saw_server(o, "a", &(struct server_value){.life = 7}, 9, 1);
        ownership_tick(o, NS_PER_S);
        assert_int_equal(ownership_has_namesake(o, NS_PER_S), !own);
        assert_int_equal(seen.writes, own);
        ownership_tick(o, LEASE_DEAD_NS + NS_PER_S);
        assert_int_equal(seen.last.replaces, 9);
        ownership_destroy(&o);
    }
}

static void what_is_known_of_others_is_who_lives_and_what_they_serve(void **state) {
    (void)state;
    struct ownership *o = begin_in();
    struct server_value b = {.life = 7, .pages = "b:4880", .secret = "1234"};
    struct cluster_peer peer;
    assert_false(ownership_peer(o, 0, 0, &peer));
    ownership_saw_server(o, "b", &b, 2, 0);
    ownership_saw_server(o, "c", &(struct server_value){0}, 3, 0); // it has left
    ownership_saw_station(o, 0, &(struct station_value){.server = "b", .life = 7}, 4, 0);
    assert_true(ownership_peer(o, 0, NS_PER_S, &peer));
    assert_string_equal(peer.name, "b");
    assert_string_equal(peer.pages, "b:4880");
    assert_string_equal(peer.secret, "1234");
    assert_true(peer.lives);
    assert_int_equal(ownership_served_by(o, 0, NS_PER_S), 0);
    assert_true(ownership_peer(o, 1, NS_PER_S, &peer));
    assert_string_equal(peer.name, "c");
    assert_false(peer.lives);
    assert_false(ownership_peer(o, 2, NS_PER_S, &peer));
    ownership_tick(o, LEASE_DEAD_NS); // it hears from NATS
    ownership_answered(o, seen.last.id, WRITE_DONE, 9, LEASE_DEAD_NS);
    assert_true(ownership_peer(o, 0, LEASE_DEAD_NS, &peer));
    assert_false(peer.lives);
    assert_int_equal(ownership_served_by(o, 0, LEASE_DEAD_NS), SERVED_NOWHERE);
    ownership_destroy(&o);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_two_servers_own_a_station_and_nothing_safe_is_lost_whatever_happens),
        cmocka_unit_test(all_stations_are_served_once_all_is_well),
        cmocka_unit_test(where_nothing_happens_nobody_loses_a_station),
        cmocka_unit_test(it_serves_until_ten_seconds_after_it_sent_its_last_good_write),
        cmocka_unit_test(a_living_server_keeps_its_station),
        cmocka_unit_test(it_tells_who_serves_and_what_it_cannot_know_stays_as_it_was),
        cmocka_unit_test(a_dead_server_is_deposed_before_its_station_is_taken),
        cmocka_unit_test(a_server_that_was_never_seen_is_deposed_before_its_station_is_taken),
        cmocka_unit_test(a_server_whose_newest_life_is_not_seen_yet_keeps_its_station),
        cmocka_unit_test(servers_are_found_by_their_names_however_many_there_are),
        cmocka_unit_test(a_deposed_server_is_in_doubt_until_it_has_taken_its_station_again),
        cmocka_unit_test(a_take_that_lands_when_it_is_not_wanted_any_more_is_released),
        cmocka_unit_test(
            a_server_stays_out_while_another_of_its_name_lives_but_not_for_the_one_before),
        cmocka_unit_test(what_is_known_of_others_is_who_lives_and_what_they_serve),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
