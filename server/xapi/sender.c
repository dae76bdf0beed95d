#include "xapi/sender.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "base/password_file.h"
#include "https/https.h"
#include "xapi/words.h"

#include <errno.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PASSWORD_MAX 256
#define REPLY_MAX 200             // bytes of a reply that the log shows
#define REPLY_BYTES_MAX (1 << 20) // a store answers with the ids of a batch

static const char of_store[] = "the learning record store"; // the password

struct sender {
    struct outbox *outbox;
    char *url, *user, *password, *authority;
    int64_t patience_ms, retry_ms, retry_most_ms;
    CURL *curl;
    struct curl_slist *headers;
    struct outbox_batch batch;
    char *body;
    char reply[REPLY_MAX + 1];
    size_t reply_bytes;
    struct error failure; // that was told last; empty: all is well
    pthread_t thread;
    pthread_mutex_t mutex;
    pthread_cond_t wake;
    bool more, stop; // under the mutex
    atomic_bool breaks_off;
};

enum outcome { SENT, REFUSED, HAD, LATER };

// ---- one request --------------------------------------------------------------------------------

static size_t take_reply(char *bytes, size_t size, size_t count, void *user) {
    struct sender *s = user;
    (void)size; // 1
    for (size_t i = 0; i < count && s->reply_bytes + i < REPLY_MAX; i++)
        s->reply[s->reply_bytes + i] = (unsigned char)bytes[i] < ' ' ? ' ' : bytes[i];
    s->reply_bytes += count;
    return s->reply_bytes > REPLY_BYTES_MAX ? 0 : count;
}

// Lines first to last of the batch as a JSON array; an empty line is none.
static void write_body(struct sender *s, int first, int last) {
    char *at = s->body;
    *at++ = '[';
    for (int i = first; i <= last; i++) {
        const char *line = s->batch.text + s->batch.starts[i];
        at += sprintf(at, "%s%s", *line && at > s->body + 1 ? "," : "", line);
    }
    memcpy(at, "]", 2);
}

static void prepare(struct sender *s) {
    CURL *c = s->curl;
    curl_easy_setopt(c, CURLOPT_URL, s->url);
    curl_easy_setopt(c, CURLOPT_HTTPAUTH, (long)CURLAUTH_BASIC);
    curl_easy_setopt(c, CURLOPT_USERNAME, s->user);
    curl_easy_setopt(c, CURLOPT_HTTPHEADER, s->headers);
    curl_easy_setopt(c, CURLOPT_WRITEFUNCTION, take_reply);
    curl_easy_setopt(c, CURLOPT_WRITEDATA, s);
    curl_easy_setopt(c, CURLOPT_TIMEOUT_MS, (long)s->patience_ms);
}

static enum outcome outcome_of(long status) {
    if (status >= 200 && status < 300)
        return SENT;
    if (status == 409)
        return HAD;
    return status == 400 || status == 413 || status == 422 ? REFUSED : LATER;
}

// *err: why not SENT.
static enum outcome post(struct sender *s, int first, int last, struct error *err) {
    char password[PASSWORD_MAX];
    long status = 0;
    if (password_file_read(s->password, of_store, password, sizeof password, err) != RESULT_OK)
        return LATER;
    write_body(s, first, last);
    memset(s->reply, 0, sizeof s->reply);
    s->reply_bytes = 0;
    curl_easy_setopt(s->curl, CURLOPT_PASSWORD, password);
    curl_easy_setopt(s->curl, CURLOPT_POSTFIELDS, s->body);
    CURLcode code = curl_easy_perform(s->curl);
    explicit_bzero(password, sizeof password);
    if (code != CURLE_OK) {
        fail(err, RESULT_IO, "%s: %s", s->url, curl_easy_strerror(code));
        return LATER;
    }
    curl_easy_getinfo(s->curl, CURLINFO_RESPONSE_CODE, &status);
    fail(err, RESULT_REFUSED, "%s: status %ld: %s", s->url, status, s->reply);
    return outcome_of(status);
}

// ---- a batch ------------------------------------------------------------------------------------

static void tell_failure(struct sender *s, const struct error *err) {
    if (strcmp(s->failure.text, err->text) && !atomic_load(&s->breaks_off))
        log_warning("xapi", "%s; the statements wait, and the server tries again", err->text);
    s->failure = *err;
}

static void tell_success(struct sender *s) {
    if (s->failure.text[0])
        log_info("xapi", "%s: it takes statements again", s->url);
    s->failure.text[0] = '\0';
}

// SENT where these lines are settled, one way or another.
static enum outcome settle(struct sender *s, int first, int last) {
    struct error err;
    const size_t *starts = s->batch.starts;
    if (outbox_sent(s->outbox, starts[last + 1] - starts[first], &err) != RESULT_OK)
        tell_failure(s, &err); // it is sent again after the next start
    return SENT;
}

static enum outcome send_lines(struct sender *s, int first, int last) {
    struct error err;
    enum outcome outcome = post(s, first, last, &err);
    if (outcome == LATER) {
        tell_failure(s, &err);
        return LATER;
    }
    tell_success(s);
    if (outcome == SENT || first == last) {
        if (outcome == REFUSED)
            log_error("xapi", "a statement is left out, as it was refused: %s", err.text);
        return settle(s, first, last);
    }
    int middle = first + (last - first) / 2;
    outcome = send_lines(s, first, middle);
    return outcome == SENT ? send_lines(s, middle + 1, last) : outcome;
}

// A line that was cut off as a server ended would spoil its batch.
static void empty_broken_lines(struct sender *s) {
    for (int i = 0; i < s->batch.count; i++) {
        char *line = s->batch.text + s->batch.starts[i];
        json_t *statement = json_loads(line, 0, NULL);
        if (!json_is_object(statement) && *line)
            log_warning("xapi", "a line of the outbox is no statement and is left out: %.40s",
                        line);
        if (!json_is_object(statement))
            *line = '\0';
        json_decref(statement);
    }
}

// False if the rest has to wait.
static bool send_all(struct sender *s) {
    struct error err;
    while (!atomic_load(&s->breaks_off)) {
        if (outbox_next(s->outbox, &s->batch, &err) != RESULT_OK) {
            tell_failure(s, &err);
            return false;
        }
        if (!s->batch.count)
            return true;
        empty_broken_lines(s);
        if (send_lines(s, 0, s->batch.count - 1) != SENT)
            return false;
    }
    return false;
}

// ---- the thread ---------------------------------------------------------------------------------

// ms < 0: until there are more lines. True: to go on.
static bool wait_for_work(struct sender *s, int64_t ms) {
    int64_t when_ns = clock_now_ns() + ms * NS_PER_MS;
    struct timespec when = {when_ns / NS_PER_S, when_ns % NS_PER_S};
    int code = 0;
    pthread_mutex_lock(&s->mutex);
    while (!s->stop && code != ETIMEDOUT && (ms >= 0 || !s->more))
        code = ms < 0 ? pthread_cond_wait(&s->wake, &s->mutex)
                      : pthread_cond_timedwait(&s->wake, &s->mutex, &when);
    s->more = false;
    bool on = !s->stop;
    pthread_mutex_unlock(&s->mutex);
    return on;
}

static void *run(void *argument) {
    struct sender *s = argument;
    struct sched_param none = {0};
    sched_setscheduler(0, SCHED_IDLE, &none);
    int64_t retry_ms = s->retry_ms;
    for (bool on = true; on;) {
        bool sent = send_all(s);
        on = wait_for_work(s, sent ? -1 : retry_ms);
        int64_t next_ms = 2 * retry_ms < s->retry_most_ms ? 2 * retry_ms : s->retry_most_ms;
        retry_ms = sent ? s->retry_ms : next_ms;
    }
    return NULL;
}

static struct curl_slist *make_headers(void) {
    struct curl_slist *headers = NULL;
    static const char *const lines[] = {"Content-Type: application/json",
                                        "X-Experience-API-Version: " XAPI_VERSION,
                                        "Expect:"}; // no pause before the body
    for (size_t i = 0; i < sizeof lines / sizeof *lines; i++) {
        headers = curl_slist_append(headers, lines[i]);
        NEED(headers, "memory");
    }
    return headers;
}

static char *url_of(const char *server) {
    size_t length = strlen(server);
    char *url = alloc(length + sizeof "/statements", 1);
    while (length && server[length - 1] == '/')
        length--;
    sprintf(url, "%.*s/statements", (int)length, server);
    return url;
}

static void start_thread(struct sender *s) {
    pthread_condattr_t monotonic;
    pthread_condattr_init(&monotonic);
    pthread_condattr_setclock(&monotonic, CLOCK_MONOTONIC);
    pthread_cond_init(&s->wake, &monotonic);
    pthread_condattr_destroy(&monotonic);
    pthread_mutex_init(&s->mutex, NULL);
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    int failed = pthread_create(&s->thread, NULL, run, s);
    NEED(!failed, "thread");
    pthread_sigmask(SIG_SETMASK, &before, NULL);
}

enum result sender_start(const struct sender_config *config, struct outbox *outbox,
                         struct sender **out, struct error *err) {
    char password[PASSWORD_MAX];
    *out = NULL;
    if (strncmp(config->server, "https://", 8))
        return fail(err, RESULT_INVALID, "%s: not an address like https://lrs.example.org/xapi",
                    config->server);
    enum result result =
        password_file_read(config->password, of_store, password, sizeof password, err);
    if (result != RESULT_OK)
        return result;
    explicit_bzero(password, sizeof password);
    struct sender *s = alloc(1, sizeof *s);
    s->outbox = outbox;
    s->url = url_of(config->server);
    s->user = alloc_text(config->user);
    s->password = alloc_text(config->password);
    s->authority = alloc_text(config->authority);
    s->patience_ms = config->patience_ms;
    s->retry_ms = config->retry_ms;
    s->retry_most_ms = config->retry_most_ms;
    s->batch.text = alloc(OUTBOX_BATCH_BYTES, 1);
    s->body = alloc(OUTBOX_BATCH_BYTES + OUTBOX_BATCH + 3, 1);
    s->headers = make_headers();
    curl_global_init(CURL_GLOBAL_DEFAULT);
    s->curl = https_create(s->authority, HTTPS_AUTHORITY, &s->breaks_off);
    prepare(s);
    start_thread(s);
    *out = s;
    return RESULT_OK;
}

void sender_wake(struct sender *s) {
    if (!s)
        return;
    pthread_mutex_lock(&s->mutex);
    s->more = true;
    pthread_cond_signal(&s->wake);
    pthread_mutex_unlock(&s->mutex);
}

void sender_stop(struct sender **sender) {
    struct sender *s = *sender;
    *sender = NULL;
    if (!s)
        return;
    atomic_store(&s->breaks_off, true);
    pthread_mutex_lock(&s->mutex);
    s->stop = true;
    pthread_cond_signal(&s->wake);
    pthread_mutex_unlock(&s->mutex);
    pthread_join(s->thread, NULL);
    curl_easy_cleanup(s->curl);
    curl_slist_free_all(s->headers);
    pthread_cond_destroy(&s->wake);
    pthread_mutex_destroy(&s->mutex);
    free(s->url);
    free(s->user);
    free(s->password);
    free(s->authority);
    free(s->batch.text);
    free(s->body);
    free(s);
}
