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

#define LOOK_NS (500 * NS_PER_MS) // at the record of revocations and the server's certificate
#define RETRY_NS (50 * NS_PER_MS) // while another process holds the keys
#define USED_MAX 64               // a station that is not among them is the next time that it comes

struct application {
    enum { FREE, WAITING, ANSWERED } state;
    struct peer *applicant; // NULL while not free: withdrawn in the middle of being answered
    struct identity identity;
    arthron_Enrol enrol;
    arthron_Control answer;
};

struct registrar {
    char *dir;
    char advice[512]; // how the server's certificate is renewed
    void (*on_news)(void *user);
    void *user;
    pthread_t thread;
    struct tls_files *tls_files; // the thread's
    int64_t look_ns;             // too: when to look at the files again
    pthread_mutex_t lock;        // never held over a file; guards what follows
    pthread_cond_t wake;
    bool stops;
    struct application applications[REGISTRAR_APPLICANTS_MAX];
    const struct application *current; // the one being answered, NULL: none
    struct revocations *revocations;   // replaced by the thread alone
    struct identity used[USED_MAX];    // whose older certificates are to be revoked
    int used_count;
    struct tls_credentials *credentials; // that nobody has taken yet, or NULL
};

// ---- applications -------------------------------------------------------------------------------

static struct application *find_state(struct registrar *r, int state) {
    for (int i = 0; i < REGISTRAR_APPLICANTS_MAX; i++)
        if ((int)r->applications[i].state == state)
            return &r->applications[i];
    return NULL;
}

bool registrar_apply(struct registrar *r, struct peer *applicant, const struct identity *identity,
                     const arthron_Enrol *enrol) {
    pthread_mutex_lock(&r->lock);
    struct application *a = find_state(r, FREE);
    if (a) {
        a->state = WAITING;
        a->applicant = applicant;
        a->identity = *identity;
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
    bool ours = result != RESULT_REFUSED && result != RESULT_FORMAT;
    if (ours) {
        log_error("control", "an enrolment failed: %s", text);
        text = "the server cannot enrol anyone now; its log says why";
    }
    *out_answer = (arthron_Control){.which_message = arthron_Control_refusal_tag};
    arthron_Refusal *refusal = &out_answer->message.refusal;
    refusal->reason = ours ? arthron_Refusal_Reason_BUSY : arthron_Refusal_Reason_CODE;
    snprintf(refusal->text, sizeof refusal->text, "%.*s", (int)sizeof refusal->text - 1, text);
}

static enum result ask_authority(const char *dir, const struct application *a,
                                 struct authority_answer *out, struct error *err) {
    const struct authority_request request = {a->enrol.request_der.bytes,
                                              a->enrol.request_der.size};
    if (a->identity.certified && !a->enrol.code[0])
        return authority_renew(dir, a->identity.name, a->identity.serial, &request, out, err);
    return authority_enrol(dir, a->enrol.code, &request, out, err);
}

static void fill_enrolled(const struct authority_answer *answer, arthron_Control *out_answer) {
    *out_answer = (arthron_Control){.which_message = arthron_Control_enrolled_tag};
    arthron_Enrolled *enrolled = &out_answer->message.enrolled;
    enrolled->certificate_der.size = (pb_size_t)answer->certificate_size;
    enrolled->authority_der.size = (pb_size_t)answer->authority_size;
    memcpy(enrolled->certificate_der.bytes, answer->certificate_der, answer->certificate_size);
    memcpy(enrolled->authority_der.bytes, answer->authority_der, answer->authority_size);
}

_Static_assert(sizeof((arthron_Enrolled *)0)->certificate_der.bytes == AUTHORITY_CERTIFICATE_MAX,
               "a certificate fits the message");

// False where another process holds the keys: to be tried again.
static bool enrol(const char *dir, const struct application *a, arthron_Control *out_answer) {
    struct authority_answer answer;
    struct error err;
    enum result result = ask_authority(dir, a, &answer, &err);
    if (result == RESULT_TIMEOUT)
        return false;
    if (result == RESULT_OK)
        fill_enrolled(&answer, out_answer);
    else
        refuse(result, &err, out_answer);
    return true;
}

// ---- certificates in use ------------------------------------------------------------------------

void registrar_used(struct registrar *r, const struct identity *identity) {
    pthread_mutex_lock(&r->lock);
    if (r->used_count < USED_MAX) {
        r->used[r->used_count++] = *identity;
        pthread_cond_signal(&r->wake);
    }
    pthread_mutex_unlock(&r->lock);
}

struct tls_credentials *registrar_take_credentials(struct registrar *r) {
    pthread_mutex_lock(&r->lock);
    struct tls_credentials *credentials = r->credentials;
    r->credentials = NULL;
    pthread_mutex_unlock(&r->lock);
    return credentials;
}

// False where another process holds the keys.
static bool revoke_older(const char *dir, const struct identity *identity) {
    int revoked;
    struct error err;
    enum result result = authority_used(dir, identity->name, identity->serial, &revoked, &err);
    if (result == RESULT_OK && revoked)
        log_info("control", "station %s has a new certificate: %d older revoked", identity->name,
                 revoked);
    else if (result != RESULT_OK && result != RESULT_TIMEOUT)
        log_error("control", "station %s: its older certificates cannot be revoked: %s",
                  identity->name, err.text);
    return result != RESULT_TIMEOUT;
}

// ---- the thread; each of these is called and returns with the lock held -------------------------

static bool answer(struct registrar *r, struct application *a) {
    arthron_Control message;
    struct application copy = *a;
    r->current = a;
    pthread_mutex_unlock(&r->lock);
    bool answered = enrol(r->dir, &copy, &message);
    pthread_mutex_lock(&r->lock);
    r->current = NULL;
    a->answer = message;
    a->state = !a->applicant ? FREE : answered ? ANSWERED : WAITING;
    if (a->state == ANSWERED)
        r->on_news(r->user);
    return answered;
}

static bool settle_used(struct registrar *r) {
    struct identity identity = r->used[r->used_count - 1];
    r->used_count--;
    pthread_mutex_unlock(&r->lock);
    bool done = revoke_older(r->dir, &identity);
    pthread_mutex_lock(&r->lock);
    if (!done && r->used_count < USED_MAX)
        r->used[r->used_count++] = identity;
    return done;
}

static void look_at_files(struct registrar *r) {
    if (clock_now_ns() < r->look_ns)
        return;
    struct revocations *before = r->revocations;
    pthread_mutex_unlock(&r->lock);
    struct revocations *now = revocations_read(r->dir, before);
    struct tls_credentials *credentials = tls_files_look(r->tls_files);
    if (credentials)
        log_info("control", "the server's certificate was renewed");
    tls_files_warn(r->tls_files, "control", r->advice);
    pthread_mutex_lock(&r->lock);
    if (now) {
        r->revocations = now;
        revocations_release(&before);
    }
    if (credentials) {
        tls_credentials_destroy(&r->credentials);
        r->credentials = credentials;
        r->on_news(r->user);
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
        look_at_files(r);
        struct application *next = find_state(r, WAITING);
        bool waits = next || r->used_count;
        bool did = next && answer(r, next);
        did |= r->used_count && settle_used(r);
        if (!did && !r->stops)
            wait_until(r, waits ? clock_now_ns() + RETRY_NS : r->look_ns);
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

struct registrar *registrar_create(const char *authority_dir, struct tls_files *tls_files,
                                   void (*on_news)(void *user), void *user) {
    struct registrar *r = alloc(1, sizeof *r);
    pthread_condattr_t monotonic;
    r->dir = alloc_text(authority_dir);
    r->tls_files = tls_files;
    snprintf(r->advice, sizeof r->advice, "run arthron-server keys renew %s", authority_dir);
    r->on_news = on_news;
    r->user = user;
    r->revocations = revocations_read(authority_dir, NULL);
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
    tls_credentials_destroy(&r->credentials);
    tls_files_destroy(&r->tls_files);
    free(r->dir);
    free(r);
    *registrar = NULL;
}
