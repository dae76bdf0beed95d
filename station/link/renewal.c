#include "link/renewal.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "link/certificate.h"
#include "link/enrol.h"
#include "link/key_files.h"
#include "link/trust.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#define DAY_S 86400
#define LOOK_NS NS_PER_S
#define RETRY_NS (3600 * NS_PER_S) // after an attempt

struct renewal {
    const struct link_config *config;
    struct renewal_handler handler;
    pthread_t thread;
    pthread_mutex_t lock; // guards nothing but the wait
    pthread_cond_t wake;
    atomic_bool stopping;
    struct key_stamps seen;
    int64_t next_ns;  // the next attempt
    int64_t warned_s; // the last warning
};

static void look_at_files(struct renewal *r) {
    struct key_stamps stamps;
    struct error err;
    key_files_stamp(r->config->keys_dir, &stamps);
    if (!memcmp(&stamps, &r->seen, sizeof stamps))
        return;
    r->seen = stamps;
    if (trust_check(r->config->keys_dir, &err) == RESULT_OK)
        r->handler.on_changed(r->handler.user);
    else
        log_warning("link", "%s; keeping the previous certificate", err.text);
}

static void warn_once_a_day(struct renewal *r, int64_t left_s, const char *why) {
    int64_t now_s = clock_utc_ns() / NS_PER_S;
    if (left_s >= RENEWAL_WARNING_DAYS * DAY_S || now_s - r->warned_s < DAY_S)
        return;
    r->warned_s = now_s;
    log_warning("link", "the station's certificate ends in %d days and could not be renewed: %s",
                (int)(left_s / DAY_S), why);
}

static void renew_in_time(struct renewal *r) {
    int64_t begin_s, end_s;
    struct server_address server;
    struct error err;
    if (link_certificate_times(r->config->keys_dir, &begin_s, &end_s, &err) != RESULT_OK)
        return; // look_at_files said so
    int64_t left_s = end_s - clock_utc_ns() / NS_PER_S;
    if (left_s >= RENEWAL_DAYS * DAY_S)
        return;
    if (!r->handler.may_ask(r->handler.user, &server)) {
        warn_once_a_day(r, left_s, "no connection to the server");
        return;
    }
    if (clock_now_ns() < r->next_ns)
        return;
    r->next_ns = clock_now_ns() + RETRY_NS;
    if (enrol_again(r->config, &server, &r->stopping, &err) == RESULT_OK)
        log_info("link", "the station's certificate was renewed");
    else
        warn_once_a_day(r, left_s, err.text);
}

static void *work(void *argument) {
    struct renewal *r = argument;
    pthread_mutex_lock(&r->lock);
    while (!atomic_load(&r->stopping)) {
        look_at_files(r);
        renew_in_time(r);
        int64_t until_ns = clock_now_ns() + LOOK_NS;
        struct timespec until = {until_ns / NS_PER_S, until_ns % NS_PER_S};
        if (!atomic_load(&r->stopping))
            pthread_cond_timedwait(&r->wake, &r->lock, &until);
    }
    pthread_mutex_unlock(&r->lock);
    return NULL;
}

struct renewal *renewal_create(const struct link_config *config,
                               const struct renewal_handler *handler) {
    struct renewal *r = alloc(1, sizeof *r);
    pthread_condattr_t monotonic;
    r->config = config;
    r->handler = *handler;
    key_files_stamp(config->keys_dir, &r->seen);
    pthread_mutex_init(&r->lock, NULL);
    pthread_condattr_init(&monotonic);
    pthread_condattr_setclock(&monotonic, CLOCK_MONOTONIC);
    pthread_cond_init(&r->wake, &monotonic);
    pthread_condattr_destroy(&monotonic);
    NEED(pthread_create(&r->thread, NULL, work, r) == 0, "thread");
    return r;
}

void renewal_destroy(struct renewal **renewal) {
    struct renewal *r = *renewal;
    if (!r)
        return;
    atomic_store(&r->stopping, true);
    pthread_mutex_lock(&r->lock);
    pthread_cond_signal(&r->wake);
    pthread_mutex_unlock(&r->lock);
    pthread_join(r->thread, NULL);
    pthread_cond_destroy(&r->wake);
    pthread_mutex_destroy(&r->lock);
    free(r);
    *renewal = NULL;
}
