#include "net/registrar.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "net/authority.h"
#include "net/authority_revocations.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LOOK_NS (500 * NS_PER_MS) // at the record of revocations
#define RETRY_NS (50 * NS_PER_MS) // while another process holds the keys

struct application {
    enum { FREE, WAITING, ANSWERED } state;
    struct peer *applicant; // NULL while not free: withdrawn in the middle of being answered
    arthron_Enrol enrol;
    arthron_Control answer;
};

struct registrar {
    char *dir;
    void (*on_news)(void *user);
    void *user;
    pthread_t thread;
    int64_t look_ns;      // the thread's: when to look at the record again
    pthread_mutex_t lock; // never held over a file; guards what follows
    pthread_cond_t wake;
    bool stops;
    struct application applications[REGISTRAR_APPLICANTS_MAX];
    const struct application *current; // the one being answered, NULL: none
    struct revocations *revocations;   // replaced by the thread alone
};

// ---- applications -------------------------------------------------------------------------------

static struct application *find_state(struct registrar *r, int state) {
    for (int i = 0; i < REGISTRAR_APPLICANTS_MAX; i++)
        if ((int)r->applications[i].state == state)
            return &r->applications[i];
    return NULL;
}

bool registrar_apply(struct registrar *r, struct peer *applicant, const arthron_Enrol *enrol) {
    pthread_mutex_lock(&r->lock);
    struct application *a = find_state(r, FREE);
    if (a) {
        a->state = WAITING;
        a->applicant = applicant;
        a->enrol = *enrol;
        pthread_cond_signal(&r->wake);
    }
    pthread_mutex_unlock(&r->lock);
    return a != NULL;
}

void registrar_withdraw(struct registrar *r, const struct peer *applicant) {
    pthread_mutex_lock(&r->lock);
    for (int i = 0; i < REGISTRAR_APPLICANTS_MAX; i++) {
        struct application *a = &r->applications[i];
        if (a->state == FREE || a->applicant != applicant)
            continue;
        a->applicant = NULL;
        if (a != r->current)
            a->state = FREE;
    }
    pthread_mutex_unlock(&r->lock);
}

bool registrar_next_answer(struct registrar *r, struct peer **out_applicant,
                           arthron_Control *out_answer) {
    pthread_mutex_lock(&r->lock);
    struct application *a = find_state(r, ANSWERED);
    if (a) {
        *out_applicant = a->applicant;
        *out_answer = a->answer;
        a->state = FREE;
    }
    pthread_mutex_unlock(&r->lock);
    return a != NULL;
}

// What the caller did wrong is told; what is wrong with the server's files is for its log.
static void refuse(enum result result, const struct error *err, arthron_Control *out_answer) {
    const char *text = err->text;
    if (result != RESULT_REFUSED && result != RESULT_FORMAT) {
        log_error("control", "an enrolment failed: %s", text);
        text = "the server cannot enrol anyone now; its log says why";
    }
    *out_answer = (arthron_Control){.which_message = arthron_Control_refusal_tag};
    arthron_Refusal *refusal = &out_answer->message.refusal;
    refusal->reason = arthron_Refusal_Reason_CODE;
    snprintf(refusal->text, sizeof refusal->text, "%.*s", (int)sizeof refusal->text - 1, text);
}

// False where another process holds the keys: to be tried again.
static bool enrol(const char *dir, const arthron_Enrol *request, arthron_Control *out_answer) {
    *out_answer = (arthron_Control){.which_message = arthron_Control_enrolled_tag};
    arthron_Enrolled *enrolled = &out_answer->message.enrolled;
    size_t certificate_size = sizeof enrolled->certificate_der.bytes;
    size_t authority_size = sizeof enrolled->authority_der.bytes;
    struct error err;
    enum result result =
        authority_enrol(dir, request->code, request->request_der.bytes, request->request_der.size,
                        enrolled->certificate_der.bytes, &certificate_size,
                        enrolled->authority_der.bytes, &authority_size, &err);
    if (result == RESULT_TIMEOUT)
        return false;
    enrolled->certificate_der.size = (pb_size_t)certificate_size;
    enrolled->authority_der.size = (pb_size_t)authority_size;
    if (result != RESULT_OK)
        refuse(result, &err, out_answer);
    return true;
}

// ---- the thread; each of these is called and returns with the lock held -------------------------

static bool answer(struct registrar *r, struct application *a) {
    arthron_Control message;
    arthron_Enrol request = a->enrol;
    r->current = a;
    pthread_mutex_unlock(&r->lock);
    bool answered = enrol(r->dir, &request, &message);
    pthread_mutex_lock(&r->lock);
    r->current = NULL;
    a->answer = message;
    a->state = !a->applicant ? FREE : answered ? ANSWERED : WAITING;
    if (a->state == ANSWERED)
        r->on_news(r->user);
    return answered;
}

static void look_at_revocations(struct registrar *r) {
    if (clock_now_ns() < r->look_ns)
        return;
    struct revocations *before = r->revocations;
    pthread_mutex_unlock(&r->lock);
    struct revocations *now = revocations_read(r->dir, before);
    pthread_mutex_lock(&r->lock);
    if (now) {
        r->revocations = now;
        revocations_release(&before);
    }
    r->look_ns = clock_now_ns() + LOOK_NS;
}

static void wait_until(struct registrar *r, int64_t until_ns) {
    struct timespec until = {until_ns / NS_PER_S, until_ns % NS_PER_S};
    pthread_cond_timedwait(&r->wake, &r->lock, &until);
}

static void *work(void *argument) {
    struct registrar *r = argument;
    pthread_mutex_lock(&r->lock);
    while (!r->stops) {
        look_at_revocations(r);
        struct application *next = find_state(r, WAITING);
        bool answered = next && answer(r, next);
        if (!answered && !r->stops)
            wait_until(r, next ? clock_now_ns() + RETRY_NS : r->look_ns);
    }
    pthread_mutex_unlock(&r->lock);
    return NULL;
}

// ---- life ---------------------------------------------------------------------------------------

bool registrar_is_revoked(struct registrar *r, const char *serial_hex) {
    pthread_mutex_lock(&r->lock);
    bool revoked = revocations_contain(r->revocations, serial_hex);
    pthread_mutex_unlock(&r->lock);
    return revoked;
}

struct registrar *registrar_create(const char *authority_dir, void (*on_news)(void *user),
                                   void *user) {
    struct registrar *r = alloc(1, sizeof *r);
    pthread_condattr_t monotonic;
    r->dir = alloc_text(authority_dir);
    r->on_news = on_news;
    r->user = user;
    r->revocations = revocations_read(authority_dir, NULL);
    r->look_ns = clock_now_ns() + LOOK_NS;
    pthread_mutex_init(&r->lock, NULL);
    pthread_condattr_init(&monotonic);
    pthread_condattr_setclock(&monotonic, CLOCK_MONOTONIC);
    pthread_cond_init(&r->wake, &monotonic);
    pthread_condattr_destroy(&monotonic);
    CHECK(pthread_create(&r->thread, NULL, work, r) == 0);
    return r;
}

void registrar_destroy(struct registrar **registrar) {
    struct registrar *r = *registrar;
    pthread_mutex_lock(&r->lock);
    r->stops = true;
    pthread_cond_signal(&r->wake);
    pthread_mutex_unlock(&r->lock);
    pthread_join(r->thread, NULL);
    pthread_cond_destroy(&r->wake);
    pthread_mutex_destroy(&r->lock);
    revocations_release(&r->revocations);
    free(r->dir);
    free(r);
    *registrar = NULL;
}
