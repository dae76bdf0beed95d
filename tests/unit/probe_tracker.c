// What `arthron-station probe` proposes for a tracker.
#include "drivers/socket.h"
#include "openigtlink_stream.h"
#include "test.h"
#include "tools/probe.h"

#include <openigtlink/igtl_transform.h>
#include <poll.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

struct server {
    int listener;
    struct bytes bytes;
};

// Says it once, and stays until the client goes.
static void *serve(void *server) {
    struct server *s = server;
    char ignored[256];
    struct pollfd ready = {.fd = s->listener, .events = POLLIN};
    poll(&ready, 1, -1);
    int fd = accept(s->listener, NULL, NULL);
    send(fd, s->bytes.data, s->bytes.size, MSG_NOSIGNAL);
    while (recv(fd, ignored, sizeof ignored, 0) > 0)
        ;
    close(fd);
    return NULL;
}

static void append_tool(struct bytes *out, const char *name, float x) {
    float matrix[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, x};
    igtl_transform_convert_byte_order(matrix);
    append_message(out, 1, "TRANSFORM", name, matrix, sizeof matrix);
}

// The config's text, for free().
static char *proposed(struct server *s) {
    char address[64], *text = NULL;
    size_t size;
    uint16_t port;
    pthread_t thread;
    struct error err;
    assert_ok(socket_listen("127.0.0.1:0", &s->listener, &port, &err));
    snprintf(address, sizeof address, "127.0.0.1:%u", port);
    assert_int_equal(pthread_create(&thread, NULL, serve, s), 0);
    FILE *config = open_memstream(&text, &size);
    json_t *out = json_array();
    assert_ok(probe_tracker(address, 0.05, config, out, &err));
    fclose(config);
    pthread_join(thread, NULL);
    close(s->listener);
    json_decref(out);
    return text;
}

static void names_are_proposed_as_they_are(void **state) {
    (void)state;
    static struct server s;
    append_tool(&s.bytes, "Stylus Tip", 100);
    append_tool(&s.bytes, "Probe               ", 200);
    append_tool(&s.bytes, "Pad #2", 300);
    append_tool(&s.bytes, "one;two", 400);
    append_tool(&s.bytes, "line\nbreak", 500);
    char *text = proposed(&s);
    assert_non_null(strstr(text, "\n; tool.CHANNEL = Stylus Tip\n"));
    assert_non_null(strstr(text, "\ntool.probe = Probe\n"));
    assert_non_null(strstr(text, "\n; tool.CHANNEL = Pad #2\n"));
    assert_null(strstr(text, "= one?two"));
    assert_null(strstr(text, "= line?break"));
    assert_non_null(strstr(text, "the config cannot have this name"));
    assert_null(strstr(text, "unit = m"));
    free(text);
}

static void metres_are_suspected_where_all_tools_seem_to_be_near(void **state) {
    (void)state;
    static struct server s;
    append_tool(&s.bytes, "probe", 1.2F);
    append_tool(&s.bytes, "punch", 0.8F);
    char *text = proposed(&s);
    assert_non_null(strstr(text, "does it send metres?\n; unit = m\n"));
    free(text);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(names_are_proposed_as_they_are),
        cmocka_unit_test(metres_are_suspected_where_all_tools_seem_to_be_near),
    };
    return cmocka_run_group_tests_name("probe_tracker", tests, NULL, NULL);
}
