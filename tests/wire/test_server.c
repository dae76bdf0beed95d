#include "wire/test_server.h"

#include "base/clock.h"
#include "link/link.h"
#include "net/authority.h"
#include "test.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

static void tell_session(struct test_server *d, struct control_peer peer) {
    arthron_Control open = {.which_message = arthron_Control_session_change_tag};
    arthron_SessionChange *change = &open.message.session_change;
    change->state = arthron_SessionState_RUNNING;
    strcpy(change->case_name, "healthy");
    change->case_hash = d->case_hash;
    change->has_knee = d->knee != NULL;
    if (d->knee)
        wire_knee_from(d->knee, &change->knee);
    control_send(d->control, peer, &open);
}

static enum result on_hello(void *user, struct control_peer peer, const arthron_Hello *hello,
                            arthron_Welcome *welcome, arthron_Refusal *refusal) {
    struct test_server *d = user;
    if (d->refusal) {
        *refusal = *d->refusal;
        atomic_fetch_add(&d->refused, 1);
        return RESULT_REFUSED;
    }
    pthread_mutex_lock(&d->lock);
    d->hello = *hello;
    d->peer = peer;
    pthread_mutex_unlock(&d->lock);
    strcpy(welcome->case_name, "healthy");
    welcome->case_hash = d->case_hash;
    welcome->hold_ms = 100;
    welcome->token = d->token;
    memcpy(welcome->session_id, d->session_id, sizeof welcome->session_id);
    tell_session(d, peer);
    if (d->keys_at_hello) {
        arthron_Control message = {.which_message = arthron_Control_udp_keys_tag};
        message.message.udp_keys = *d->keys_at_hello;
        control_send(d->control, peer, &message);
    }
    atomic_fetch_add(&d->hellos, 1);
    return RESULT_OK;
}

static void on_clock(void *user, struct control_peer peer, int64_t offset_ns,
                     int64_t uncertainty_ns, int64_t rtt_ns) {
    struct test_server *d = user;
    tell_session(d, peer);
    pthread_mutex_lock(&d->lock);
    d->offset_ns = offset_ns;
    d->uncertainty_ns = uncertainty_ns;
    d->rtt_ns = rtt_ns;
    pthread_mutex_unlock(&d->lock);
    atomic_fetch_add(&d->clocks, 1);
}

static void on_frame(void *user, struct control_peer peer, const arthron_Frame *message,
                     int64_t received_ns) {
    (void)received_ns;
    struct test_server *d = user;
    arthron_Control reply = {.which_message = arthron_Control_reply_tag};
    reply.message.reply.frame_number = message->number;
    reply.message.reply.frame_time_ns = message->time_ns;
    control_send(d->control, peer, &reply);
    atomic_fetch_add(&d->frames, 1);
}

static void on_message(void *user, struct control_peer peer, const arthron_Control *message) {
    struct test_server *d = user;
    if (message->which_message != arthron_Control_udp_path_tag) {
        if (d->on_mesh)
            d->on_mesh(d, peer, message);
        return;
    }
    pthread_mutex_lock(&d->lock);
    d->challenge = message->message.udp_path.challenge;
    pthread_mutex_unlock(&d->lock);
    atomic_fetch_add(&d->messages, 1);
}

static void on_gone(void *user, struct control_peer peer) {
    (void)peer;
    atomic_fetch_add(&((struct test_server *)user)->gone, 1);
}

void test_server_start(struct test_server *d) {
    struct control_handler handler = {.user = d,
                                      .on_hello = on_hello,
                                      .on_clock = on_clock,
                                      .on_frame = on_frame,
                                      .on_message = on_message,
                                      .on_gone = on_gone};
    struct control_config config = {
        .address = "127.0.0.1",
        .port = d->port,
        .stations = TEST_SERVER_STATIONS,
        .authority_dir = d->keys,
        .software = "test_server",
        .hello_timeout_ns = d->hello_timeout_ns ? d->hello_timeout_ns : 5 * NS_PER_S,
    };
    struct error err;
    if (control_create(&config, &handler, &d->control, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    d->port = control_port(d->control);
}

void test_server_stop(struct test_server *d) {
    control_destroy(&d->control);
}

void test_server_open(struct test_server *d) {
    const char *hosts[] = {"localhost", "127.0.0.1"};
    struct error err;
    folder_make(d->dir);
    snprintf(d->keys, sizeof d->keys, "%s/keys", d->dir);
    pthread_mutex_init(&d->lock, NULL);
    if (authority_init(d->keys, d->only_host ? &d->only_host : hosts, d->only_host ? 1 : 2, &err) !=
        RESULT_OK)
        fail_msg("%s", err.text);
    test_server_start(d);
}

void test_server_close(struct test_server *d) {
    if (d->control)
        test_server_stop(d);
    pthread_mutex_destroy(&d->lock);
    folder_remove(d->dir);
}

void test_server_enrol(struct test_server *d, const char *station, char out_keys_dir[128]) {
    char code[AUTHORITY_CODE_MAX];
    struct error err;
    snprintf(out_keys_dir, 128, "%s/%s", d->dir, station);
    if (authority_issue_code(d->keys, station, code, &err) != RESULT_OK ||
        link_enrol("localhost", d->port, code, station, out_keys_dir, &err) != RESULT_OK)
        fail_msg("%s", err.text);
}

bool wait_for(atomic_int *counter, int wanted) {
    int64_t until_ns = clock_now_ns() + 10 * NS_PER_S;
    while (atomic_load(counter) < wanted && clock_now_ns() < until_ns)
        usleep(2000);
    return atomic_load(counter) >= wanted;
}
