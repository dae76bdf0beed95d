// A server of OpenIGTLink on sockets: several clients that read, one that never does.

#include "base/clock.h"
#include "igtl/framing.h"
#include "igtl/server.h"
#include "igtl_bytes.h"
#include "test.h"

#include <arpa/inet.h>
#include <errno.h>
#include <poll.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

static struct igtl_server *server;

static int begin(void **state) {
    (void)state;
    const struct igtl_server_config config = {.device = "Arthron"};
    struct error err;
    assert_ok(igtl_server_create(&config, &server, &err));
    return 0;
}

static int end(void **state) {
    (void)state;
    igtl_server_destroy(&server);
    assert_null(server);
    return 0;
}

// ---- clients ------------------------------------------------------------------------------------

struct reader {
    int fd;
    struct igtl_framing framing;
    int sets, skipped, meshes, strings, statuses; // skipped: sets that did not come
    double newest;                                // of the sets
    size_t mesh_size;
    char text[IGTL_TEXT_SIZE];
};

static void connect_reader(struct reader *r) {
    struct sockaddr_in address = {.sin_family = AF_INET,
                                  .sin_port = htons((uint16_t)igtl_server_port(server)),
                                  .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    memset(r, 0, sizeof *r);
    r->fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    assert_int_equal(0, connect(r->fd, (struct sockaddr *)&address, sizeof address));
    igtl_framing_init(&r->framing);
}

static void wait_for_clients(int count) {
    for (int i = 0; i < 5000 && igtl_server_clients(server) != count; i++)
        nanosleep(&(struct timespec){0, NS_PER_MS}, NULL);
    assert_int_equal(count, igtl_server_clients(server));
}

static void take_frame(struct reader *r, const struct igtl_frame *frame) {
    assert_true(frame->intact && frame->known);
    r->meshes += !strcmp(frame->type, "POLYDATA");
    if (!strcmp(frame->type, "POLYDATA"))
        r->mesh_size = frame->body_size;
    r->statuses += !strcmp(frame->type, "STATUS");
    if (!strcmp(frame->type, "STRING")) {
        r->strings++;
        memcpy(r->text, frame->body + 4, frame->body_size - 4);
        r->text[frame->body_size - 4] = 0;
    }
    if (strcmp(frame->type, "TRANSFORM") != 0)
        return;
    double number = float_at(frame->body + 36);
    r->skipped += r->sets ? (int)(number - r->newest) - 1 : 0;
    r->newest = number;
    r->sets++;
}

// What there is now. False: the server has closed.
static bool read_now(struct reader *r) {
    uint8_t bytes[65536];
    ssize_t size;
    while ((size = recv(r->fd, bytes, sizeof bytes, MSG_DONTWAIT)) > 0)
        for (ssize_t at = 0; at < size;) {
            enum igtl_framing_event event;
            struct igtl_frame frame;
            struct error err;
            at += (ssize_t)igtl_framing_feed(&r->framing, bytes + at, (size_t)(size - at), &event,
                                             &frame, &err);
            assert_int_not_equal(IGTL_FRAMING_BROKEN, event);
            if (event == IGTL_FRAMING_MESSAGE)
                take_frame(r, &frame);
        }
    return size < 0 && (errno == EAGAIN || errno == EWOULDBLOCK);
}

#define READ_UNTIL(reader, condition)                                                              \
    do {                                                                                           \
        for (int tries = 0; tries < 5000 && !(condition); tries++) {                               \
            assert_true(read_now(reader));                                                         \
            nanosleep(&(struct timespec){0, NS_PER_MS}, NULL);                                     \
        }                                                                                          \
        assert_true(condition);                                                                    \
    } while (0)

// ---- what is served -----------------------------------------------------------------------------

// Waits while the server's thread is behind.
static void put_set(int number) {
    struct igtl_poses set = {.utc_ns = clock_utc_ns(), .count = 1};
    strcpy(set.poses[0].name, "probe");
    set.poses[0].utc_ns = set.utc_ns;
    set.poses[0].T_world_body = pose_identity();
    set.poses[0].T_world_body.translation.x = number;
    while (!igtl_server_put_poses(server, &set))
        nanosleep(&(struct timespec){0, NS_PER_MS}, NULL);
}

// With twice as many triangles: 44 bytes a vertex.
enum { SMALL = 1000, LARGE = 20000 };

static void put_mesh(int vertices) {
    int count = 2 * vertices;
    float *positions = calloc(3 * (size_t)vertices, sizeof *positions);
    uint32_t *triangles = calloc(3 * (size_t)count, sizeof *triangles);
    struct igtl_mesh mesh = {.name = "meniscus",
                             .vertex_count = vertices,
                             .triangle_count = count,
                             .positions = positions,
                             .triangles = triangles};
    for (int i = 0; i < 3 * count; i++)
        triangles[i] = (uint32_t)(i % vertices);
    igtl_server_put_mesh(server, &mesh);
    free(positions);
    free(triangles);
}

// ---- tests --------------------------------------------------------------------------------------

// Sets come faster than 60 Hz, and a mesh that a connection has room for now and then.
static void three_clients_that_read_lose_nothing_beside_one_that_never_does(void **state) {
    (void)state;
    enum { READERS = 3, SETS = 600 };
    static struct reader readers[READERS], idle;
    for (int i = 0; i < READERS; i++)
        connect_reader(&readers[i]);
    connect_reader(&idle);
    wait_for_clients(READERS + 1);
    for (int i = 1; i <= SETS; i++) {
        put_set(i);
        if (i % 100 == 0)
            put_mesh(SMALL);
        for (int k = 0; k < READERS; k++)
            assert_true(read_now(&readers[k]));
        nanosleep(&(struct timespec){0, NS_PER_MS}, NULL);
    }
    for (int k = 0; k < READERS; k++) {
        READ_UNTIL(&readers[k], readers[k].newest == SETS && readers[k].mesh_size);
        assert_int_equal(SETS, readers[k].sets);
        assert_int_equal(0, readers[k].skipped);
        assert_int_equal(igtl_polydata_size(SMALL, 2 * SMALL), readers[k].mesh_size);
        close(readers[k].fd);
    }
    assert_int_equal(0, idle.sets);
    close(idle.fd);
    wait_for_clients(0);
}

static void *read_to_256(void *reader) {
    struct reader *r = reader;
    while (r->newest < 256) {
        poll(&(struct pollfd){.fd = r->fd, .events = POLLIN}, 1, 5000);
        if (!read_now(r))
            break;
    }
    return NULL;
}

// As many as wait at most for the server's thread.
static void a_client_that_reads_loses_nothing_of_a_burst(void **state) {
    (void)state;
    struct reader reader;
    pthread_t thread;
    connect_reader(&reader);
    wait_for_clients(1);
    assert_int_equal(0, pthread_create(&thread, NULL, read_to_256, &reader));
    for (int i = 1; i <= 256; i++)
        put_set(i);
    pthread_join(thread, NULL);
    assert_true(reader.newest >= 256);
    assert_int_equal(0, reader.skipped);
    close(reader.fd);
}

// Its connection is full, so that it gets what was under way, and then the newest.
static void a_client_that_reads_again_gets_the_newest_set(void **state) {
    (void)state;
    static struct reader late;
    int number = 0;
    connect_reader(&late);
    wait_for_clients(1);
    for (int i = 0; i < 20; i++)
        put_mesh(LARGE); // what is not taken is replaced: the first one fills the connection
    // More than a quarter of a second, and more sets than one.
    for (int64_t end_ns = clock_now_ns() + 400 * NS_PER_MS;
         clock_now_ns() < end_ns || number < 9;) {
        put_set(++number);
        nanosleep(&(struct timespec){0, NS_PER_MS}, NULL);
    }
    READ_UNTIL(&late, late.newest == number);
    assert_true(late.sets < number && late.meshes < 20);
    close(late.fd);
    wait_for_clients(0);
}

static void who_lets_too_many_strings_wait_is_dropped(void **state) {
    (void)state;
    static struct reader idle;
    connect_reader(&idle);
    wait_for_clients(1);
    put_mesh(LARGE);
    for (int i = 0; i < 2000 && igtl_server_clients(server); i++) {
        igtl_server_put_string(server, "events", "contact", 0);
        put_mesh(LARGE);
        nanosleep(&(struct timespec){0, NS_PER_MS / 4}, NULL);
    }
    wait_for_clients(0);
    close(idle.fd);
}

static void texts_and_the_state_come_to_all_and_the_state_to_who_comes_later(void **state) {
    (void)state;
    static struct reader first, second;
    struct igtl_state running = {.code = 1, .text = "running"};
    connect_reader(&first);
    wait_for_clients(1);
    igtl_server_put_string(server, "events", "contact", 0);
    igtl_server_put_status(server, &running);
    READ_UNTIL(&first, first.strings == 1 && first.statuses == 1);
    assert_string_equal("contact", first.text);
    connect_reader(&second);
    READ_UNTIL(&second, second.statuses == 1);
    assert_int_equal(0, second.strings);
    close(first.fd);
    close(second.fd);
    wait_for_clients(0);
}

static void a_set_that_nobody_watched_is_there_for_the_first_client(void **state) {
    (void)state;
    static struct reader reader;
    put_set(1);
    put_set(2);
    connect_reader(&reader);
    READ_UNTIL(&reader, reader.sets == 1);
    assert_near(2, reader.newest, 0);
    close(reader.fd);
    wait_for_clients(0);
}

static void who_sends_what_is_no_message_is_dropped_and_one_too_many_is_turned_away(void **state) {
    (void)state;
    static struct reader readers[IGTL_CLIENTS_MAX + 1];
    uint8_t junk[58];
    for (int i = 0; i < IGTL_CLIENTS_MAX; i++)
        connect_reader(&readers[i]);
    wait_for_clients(IGTL_CLIENTS_MAX);
    connect_reader(&readers[IGTL_CLIENTS_MAX]);
    for (int i = 0; i < 5000 && read_now(&readers[IGTL_CLIENTS_MAX]); i++)
        nanosleep(&(struct timespec){0, NS_PER_MS}, NULL);
    assert_false(read_now(&readers[IGTL_CLIENTS_MAX]));
    memset(junk, 'x', sizeof junk);
    assert_int_equal(sizeof junk, send(readers[0].fd, junk, sizeof junk, MSG_NOSIGNAL));
    wait_for_clients(IGTL_CLIENTS_MAX - 1);
    put_set(1);
    READ_UNTIL(&readers[1], readers[1].sets == 1);
    for (int i = 0; i <= IGTL_CLIENTS_MAX; i++)
        close(readers[i].fd);
    wait_for_clients(0);
}

static void it_listens_on_addresses_only_and_says_why_it_cannot(void **state) {
    (void)state;
    struct igtl_server *other;
    struct igtl_server_config config = {.address = "loopback"};
    struct error err = {0};
    assert_int_equal(RESULT_INVALID, igtl_server_create(&config, &other, &err));
    assert_null(other);
    assert_non_null(strstr(err.text, "loopback"));
    config = (struct igtl_server_config){.port = igtl_server_port(server)};
    assert_int_equal(RESULT_IO, igtl_server_create(&config, &other, &err));
    assert_non_null(strstr(err.text, "in use"));
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, begin, end)

int main(void) {
    const struct CMUnitTest tests[] = {
        TEST(three_clients_that_read_lose_nothing_beside_one_that_never_does),
        TEST(a_client_that_reads_loses_nothing_of_a_burst),
        TEST(a_client_that_reads_again_gets_the_newest_set),
        TEST(who_lets_too_many_strings_wait_is_dropped),
        TEST(texts_and_the_state_come_to_all_and_the_state_to_who_comes_later),
        TEST(a_set_that_nobody_watched_is_there_for_the_first_client),
        TEST(who_sends_what_is_no_message_is_dropped_and_one_too_many_is_turned_away),
        TEST(it_listens_on_addresses_only_and_says_why_it_cannot),
    };
    return cmocka_run_group_tests_name("igtl_server", tests, NULL, NULL);
}
