// The connection with NATS: a real server of it, keys that compare revisions, messages that are
// kept once, and what happens when it ends and comes back.
#include "cluster/jet.h"

#include "cluster/keys.h"
#include "folder.h"
#include "test.h"

#include <arpa/inet.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#define PATIENCE_S 30
#define ANSWERS_MAX 1024
#define SEEN_MAX 64
#define FOLLOWERS 200

static char folder[FOLDER_MAX];
static int port;
static pid_t nats;
static struct error err;

// ---- what comes back ----------------------------------------------------------------------------

static struct {
    pthread_mutex_t lock;
    pthread_cond_t changed;
    struct {
        bool there;
        enum write_answer answer;
        uint64_t revision;
    } answers[ANSWERS_MAX];
    struct {
        char key[64], value[64];
        uint64_t revision;
    } seen[SEEN_MAX];
    int seen_count;
    bool connected;
} heard = {.lock = PTHREAD_MUTEX_INITIALIZER, .changed = PTHREAD_COND_INITIALIZER};

static void on_answer(void *user, uint64_t id, enum write_answer answer, uint64_t revision) {
    (void)user;
    pthread_mutex_lock(&heard.lock);
    assert_true(id < ANSWERS_MAX);
    assert_false(heard.answers[id].there);
    heard.answers[id].answer = answer;
    heard.answers[id].revision = revision;
    heard.answers[id].there = true;
    pthread_cond_broadcast(&heard.changed);
    pthread_mutex_unlock(&heard.lock);
}

static void on_key(void *user, const char *key, const char *value, size_t size, uint64_t revision) {
    (void)user;
    pthread_mutex_lock(&heard.lock);
    assert_true(heard.seen_count < SEEN_MAX);
    int i = heard.seen_count++;
    snprintf(heard.seen[i].key, sizeof heard.seen[i].key, "%s", key);
    snprintf(heard.seen[i].value, sizeof heard.seen[i].value, "%.*s", (int)size, value);
    heard.seen[i].revision = revision;
    pthread_cond_broadcast(&heard.changed);
    pthread_mutex_unlock(&heard.lock);
}

static void on_connected(void *user, bool is_connected) {
    (void)user;
    pthread_mutex_lock(&heard.lock);
    heard.connected = is_connected;
    pthread_cond_broadcast(&heard.changed);
    pthread_mutex_unlock(&heard.lock);
}

static bool wait_for(bool (*is_so)(uint64_t of), uint64_t of) {
    struct timespec until;
    clock_gettime(CLOCK_REALTIME, &until);
    until.tv_sec += PATIENCE_S;
    pthread_mutex_lock(&heard.lock);
    bool so = is_so(of);
    while (!so && pthread_cond_timedwait(&heard.changed, &heard.lock, &until) == 0)
        so = is_so(of);
    pthread_mutex_unlock(&heard.lock);
    return so;
}

static bool is_answered(uint64_t id) {
    return heard.answers[id].there;
}

static bool is_connected(uint64_t wanted) {
    return heard.connected == (wanted != 0);
}

static bool is_seen(uint64_t revision) {
    for (int i = 0; i < heard.seen_count; i++)
        if (heard.seen[i].revision == revision)
            return true;
    return false;
}

// ---- NATS ---------------------------------------------------------------------------------------

static int free_port(void) {
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof at;
    int fd = socket(AF_INET, SOCK_STREAM, 0);
    assert_int_equal(bind(fd, (struct sockaddr *)&at, size), 0);
    getsockname(fd, (struct sockaddr *)&at, &size);
    close(fd);
    return ntohs(at.sin_port);
}

static void start_nats(void) {
    char number[16];
    snprintf(number, sizeof number, "%d", port);
    nats = fork();
    if (nats == 0) {
        execlp("nats-server", "nats-server", "-a", "127.0.0.1", "-p", number, "-js", "-sd", folder,
               "-l", "/dev/null", NULL);
        _exit(127);
    }
}

static void end_nats(void) {
    kill(nats, SIGKILL);
    waitpid(nats, NULL, 0);
}

static struct jet *connect_jet(void) {
    const struct jet_handler handler = {NULL, on_answer, on_key, on_connected};
    struct jet_settings settings = {.name = "a", .server_count = 1, .replicas = 1};
    struct jet *jet;
    snprintf(settings.servers[0], sizeof settings.servers[0], "nats://127.0.0.1:%d", port);
    assert_ok(jet_create(&settings, &handler, &jet, &err));
    return jet;
}

static int begin(void **state) {
    memset(heard.answers, 0, sizeof heard.answers);
    heard.seen_count = 0;
    heard.connected = false;
    folder_make(folder);
    port = free_port();
    start_nats();
    *state = connect_jet();
    return wait_for(is_connected, true) ? 0 : -1;
}

static int finish(void **state) {
    jet_destroy((struct jet **)state);
    end_nats();
    folder_remove(folder);
    return 0;
}

// The streams are made after the connection, so the first writes may find none.
static uint64_t write_key(struct jet *jet, uint64_t *ids, const char *key, uint64_t replaces,
                          const char *value, enum write_answer expected) {
    for (int i = 0; i < 300; i++) {
        uint64_t id = ++*ids;
        jet_write_key(jet, id, key, replaces, value);
        assert_true(wait_for(is_answered, id));
        if (heard.answers[id].answer == expected)
            return heard.answers[id].revision;
        assert_int_equal(heard.answers[id].answer, WRITE_UNKNOWN);
        usleep(100000);
    }
    fail_msg("no such answer");
    return 0;
}

// ---- tests --------------------------------------------------------------------------------------

static void of_two_writers_of_a_revision_one_comes_late(void **state) {
    struct jet *jet = *state;
    uint64_t ids = 0;
    uint64_t first = write_key(jet, &ids, "station.room-1", 0, "{\"a\":1}", WRITE_DONE);
    assert_true(wait_for(is_seen, first));
    write_key(jet, &ids, "station.room-1", 0, "{\"a\":2}", WRITE_LATE);
    uint64_t second = write_key(jet, &ids, "station.room-1", first, "{\"a\":3}", WRITE_DONE);
    assert_true(second > first);
    assert_true(wait_for(is_seen, second));
    for (int i = 0; i < heard.seen_count; i++) {
        assert_string_equal(heard.seen[i].key, "station.room-1");
        assert_string_equal(heard.seen[i].value,
                            heard.seen[i].revision == first ? "{\"a\":1}" : "{\"a\":3}");
    }
}

struct read {
    int count;
    uint64_t numbers[8];
    size_t sizes[8];
};

static bool take(void *user, const struct jet_message *message, uint64_t sequence) {
    struct read *read = user;
    (void)sequence;
    assert_int_equal(message->token, 7);
    assert_string_equal(message->kind, "record");
    read->numbers[read->count] = message->number;
    read->sizes[read->count++] = message->size;
    return read->count < 8;
}

static void a_message_is_kept_once_and_read_in_order_until_it_is_purged(void **state) {
    struct jet *jet = *state;
    uint64_t ids = 0, last = 0;
    static char bytes[JET_PART_MAX];
    write_key(jet, &ids, "station.room-1", 0, "{}", WRITE_DONE); // all streams are there
    const uint64_t numbers[] = {1, 2, 2, 3};
    for (size_t i = 0; i < 4; i++) {
        struct jet_message message = {JET_JOURNAL "room-1",
                                      7,
                                      numbers[i],
                                      "record",
                                      bytes,
                                      i ? 10 * numbers[i] : sizeof bytes};
        jet_send(jet, ++ids, jet_pack(&message));
        assert_true(wait_for(is_answered, ids));
        assert_int_equal(heard.answers[ids].answer, WRITE_DONE);
        last = heard.answers[ids].revision;
    }
    struct read read = {0};
    jet_purge(jet, JET_JOURNAL "room-1", 1); // nothing is before the first
    usleep(300000);
    assert_ok(jet_read(jet, JET_JOURNAL "room-1", 0, take, &read, &err));
    assert_int_equal(read.count, 3);
    for (int i = 0; i < 3; i++)
        assert_int_equal(read.numbers[i], i + 1);
    assert_int_equal(read.sizes[0], JET_PART_MAX);
    assert_int_equal(read.sizes[2], 30);
    jet_purge(jet, JET_JOURNAL "room-1", last);
    for (int i = 0; i < 100 && read.count != 1; i++) {
        usleep(50000);
        read.count = 0;
        assert_ok(jet_read(jet, JET_JOURNAL "room-1", 0, take, &read, &err));
    }
    assert_int_equal(read.numbers[0], 3);
    assert_int_equal(jet_read(jet, JET_JOURNAL "room-2", 0, take, &read, &err), RESULT_MISSING);
}

static void a_subject_is_followed_and_erased(void **state) {
    struct jet *jet = *state;
    struct jet_follower *follower;
    struct jet_message message = {
        .subject = JET_RECORDS "x", .token = 3, .kind = "change", .data = "abc", .size = 3};
    char value[16];
    uint64_t sequence = 0, revision, at;
    while (jet_read_key(jet, "records", value, sizeof value, &revision, &err) == RESULT_TIMEOUT)
        usleep(100000); // until all streams are there
    assert_ok(jet_last_of_records(jet, &sequence, &err));
    assert_int_equal(sequence, 0);
    message.number = 1;
    assert_ok(jet_publish_now(jet, &message, &sequence, &err));
    assert_ok(jet_follow(jet, message.subject, 2, &follower, &err));
    for (message.number = 2; message.number <= 3; message.number++)
        assert_ok(jet_publish_now(jet, &message, &sequence, &err));
    assert_int_equal(sequence, 3);
    for (uint64_t number = 2; number <= 3; number++) {
        assert_ok(jet_follow_next(follower, PATIENCE_S * 1000, &message, &at, &err));
        assert_true(message.number == number && at == number && message.token == 3);
        assert_memory_equal(message.data, "abc", 3);
    }
    assert_int_equal(jet_follow_next(follower, 10, &message, &at, &err), RESULT_MISSING);
    jet_follow_end(&follower);
    assert_ok(jet_erase(jet, JET_RECORDS "x", 3, &err));
    assert_ok(jet_follow(jet, JET_RECORDS "x", 1, &follower, &err));
    assert_ok(jet_follow_next(follower, PATIENCE_S * 1000, &message, &at, &err));
    assert_int_equal(at, 3);
    jet_follow_end(&follower);
}

struct babble {
    struct jet *jet;
    atomic_bool ends;
};

static void *publish_until_end(void *argument) {
    static const char data[1 << 10];
    struct babble *babble = argument;
    struct jet_message message = {.subject = JET_RECORDS "y",
                                  .token = 1,
                                  .kind = "change",
                                  .data = data,
                                  .size = sizeof data};
    uint64_t sequence;
    while (!atomic_load(&babble->ends)) {
        message.number++;
        jet_publish_now(babble->jet, &message, &sequence, NULL);
    }
    return NULL;
}

// The library's reading thread may be about to deliver to a subscription that ends.
static void a_follower_ends_while_messages_come(void **state) {
    struct jet *jet = *state;
    struct babble babble = {.jet = jet};
    pthread_t threads[4];
    char value[16];
    uint64_t revision;
    while (jet_read_key(jet, "records", value, sizeof value, &revision, &err) == RESULT_TIMEOUT)
        usleep(100000); // until all streams are there
    for (int i = 0; i < 4; i++)
        assert_int_equal(pthread_create(&threads[i], NULL, publish_until_end, &babble), 0);
    for (int i = 0; i < FOLLOWERS; i++) {
        struct jet_follower *follower;
        struct jet_message message;
        uint64_t at;
        assert_ok(jet_follow(jet, JET_RECORDS "y", 1, &follower, &err));
        assert_ok(jet_follow_next(follower, PATIENCE_S * 1000, &message, &at, &err));
        assert_int_equal(at, 1);
        jet_follow_end(&follower);
    }
    atomic_store(&babble.ends, true);
    for (int i = 0; i < 4; i++)
        pthread_join(threads[i], NULL);
}

static void a_key_is_replaced_by_the_first_of_two(void **state) {
    struct jet *jet = *state;
    char value[16];
    uint64_t first = 0, second;
    while (jet_read_key(jet, "records", value, sizeof value, &first, &err) == RESULT_TIMEOUT)
        usleep(100000); // until NATS is there
    assert_ok(jet_replace_key(jet, "records", 0, "one", &err));
    assert_int_equal(jet_replace_key(jet, "records", 0, "two", &err), RESULT_REFUSED);
    assert_ok(jet_read_key(jet, "records", value, sizeof value, &first, &err));
    assert_string_equal(value, "one");
    assert_ok(jet_replace_key(jet, "records", first, "three", &err));
    assert_int_equal(jet_replace_key(jet, "records", first, "four", &err), RESULT_REFUSED);
    assert_ok(jet_read_key(jet, "records", value, sizeof value, &second, &err));
    assert_string_equal(value, "three");
    assert_int_equal(jet_read_key(jet, "records", value, 5, &second, &err), RESULT_LIMIT);
}

static void what_cannot_be_sent_is_unknown_and_all_goes_on_when_nats_is_back(void **state) {
    struct jet *jet = *state;
    uint64_t ids = 0;
    uint64_t first = write_key(jet, &ids, "server.a", 0, "{\"a\":1}", WRITE_DONE);
    assert_true(wait_for(is_seen, first));
    end_nats();
    assert_true(wait_for(is_connected, false));
    jet_write_key(jet, ++ids, "server.a", first, "{\"a\":2}");
    assert_true(wait_for(is_answered, ids));
    assert_int_equal(heard.answers[ids].answer, WRITE_UNKNOWN);
    struct read read = {0};
    assert_int_equal(jet_read(jet, JET_JOURNAL "room-1", 0, take, &read, &err), RESULT_TIMEOUT);
    start_nats();
    assert_true(wait_for(is_connected, true));
    uint64_t second = write_key(jet, &ids, "server.a", first, "{\"a\":3}", WRITE_DONE);
    assert_true(wait_for(is_seen, second));
}

static int looked;

static void take_key(void *user, const char *key, const char *value, size_t size) {
    (void)user;
    const char *expected = strcmp(key, "server.a") ? "{\"b\":2}" : "{\"a\":3}";
    assert_int_equal(size, strlen(expected));
    assert_memory_equal(value, expected, size);
    looked++;
}

static void a_look_shows_each_key_once_and_says_that_nats_is_away(void **state) {
    struct jet *jet = *state;
    uint64_t ids = 0;
    struct jet_settings settings = {.name = "look", .server_count = 1, .replicas = 1};
    snprintf(settings.servers[0], sizeof settings.servers[0], "nats://127.0.0.1:%d", port);
    uint64_t first = write_key(jet, &ids, "server.a", 0, "{\"a\":1}", WRITE_DONE);
    write_key(jet, &ids, "server.a", first, "{\"a\":3}", WRITE_DONE);
    write_key(jet, &ids, "server.b", 0, "{\"b\":2}", WRITE_DONE);
    assert_ok(jet_look(&settings, take_key, NULL, &err));
    assert_int_equal(looked, 2);
    end_nats();
    assert_int_not_equal(jet_look(&settings, take_key, NULL, &err), RESULT_OK);
    assert_non_null(strstr(err.text, "NATS"));
    start_nats();
}

static void a_name_is_a_token_and_back(void **state) {
    (void)state;
    static const char *const names[] = {"room-1", "a.b", "Raum 3*>", "x=y", "_"};
    char token[JET_TOKEN_SIZE], name[SERVER_NAME_SIZE];
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        jet_token(names[i], token);
        assert_null(strpbrk(token, ".*> "));
        assert_true(jet_name(token, name));
        assert_string_equal(name, names[i]);
    }
    assert_false(jet_name("", name));
    assert_false(jet_name("a=", name));
    assert_false(jet_name("a=G", name));
}

static void a_servers_key_is_read_as_it_was_written_and_without_a_secret(void **state) {
    (void)state;
    char text[KEY_VALUE_SIZE];
    const char *old = "{\"stations\":\"b:4810\",\"pages\":\"\",\"life\":\"0a\",\"write\":3}";
    struct server_value read, b = {.life = UINT64_MAX,
                                   .write = 5,
                                   .stations = "b:4810",
                                   .pages = "b:4880",
                                   .secret = "1234"};
    key_server_text(&b, text);
    assert_true(key_server_value(text, strlen(text), &read));
    assert_int_equal(read.life, b.life);
    assert_int_equal(read.write, 5);
    assert_string_equal(read.pages, "b:4880");
    assert_string_equal(read.secret, "1234");
    assert_true(key_server_value(old, strlen(old), &read));
    assert_int_equal(read.life, 10);
    assert_string_equal(read.secret, "");
    assert_false(key_server_value("", 0, &read));
}

int main(void) {
    if (system("nats-server --version >/dev/null 2>&1") != 0) {
        puts("there is no nats-server");
        return 77;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(of_two_writers_of_a_revision_one_comes_late, begin, finish),
        cmocka_unit_test_setup_teardown(a_message_is_kept_once_and_read_in_order_until_it_is_purged,
                                        begin, finish),
        cmocka_unit_test_setup_teardown(a_subject_is_followed_and_erased, begin, finish),
        cmocka_unit_test_setup_teardown(a_follower_ends_while_messages_come, begin, finish),
        cmocka_unit_test_setup_teardown(a_key_is_replaced_by_the_first_of_two, begin, finish),
        cmocka_unit_test_setup_teardown(
            what_cannot_be_sent_is_unknown_and_all_goes_on_when_nats_is_back, begin, finish),
        cmocka_unit_test_setup_teardown(a_look_shows_each_key_once_and_says_that_nats_is_away,
                                        begin, finish),
        cmocka_unit_test(a_name_is_a_token_and_back),
        cmocka_unit_test(a_servers_key_is_read_as_it_was_written_and_without_a_secret),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
