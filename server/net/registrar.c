#include "net/registrar.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "base/task_pool.h"
#include "net/authority.h"
#include "net/authority_revocations.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LOOK_NS (250 * NS_PER_MS)       // at the record of revocations and the server's certificate
#define RETRY_NS (50 * NS_PER_MS)       // while another process holds the keys
#define RENEWAL_S (60 * INT64_C(86400)) // before its end the server's certificate is renewed
#define RENEWAL_RETRY_S 3600
#define USED_MAX 64 // a station that is not among them is the next time that it comes

// With the look at the files, and one that has left its place and is being finished.
#define TASKS_MAX (2 + REGISTRAR_APPLICANTS_MAX + USED_MAX)

struct application {
    struct registrar *registrar;
    enum { FREE, WAITING, ANSWERED } state;
    struct peer *applicant; // NULL while not free: withdrawn
    struct identity identity;
    arthron_Enrol enrol;
    arthron_Control answer; // the thread's while the state is WAITING
};

// A certificate with which a station has come.
struct used_certificate {
    struct registrar *registrar;
    bool waits;
    struct identity identity;
};

struct registrar {
    char *dir;
    char advice[512]; // how the server's certificate is renewed
    void (*on_news)(void *user);
    void *user;
    struct task_pool *tasks;
    struct tls_files *tls_files; // the thread's
    int64_t renewed_s;           // the last attempt; the thread's
    pthread_mutex_t lock;        // never held over a file; guards what follows
    struct application applications[REGISTRAR_APPLICANTS_MAX];
    struct revocations *revocations; // replaced by the thread alone
    bool is_new;                     // since registrar_take_revoked
    struct used_certificate used[USED_MAX];
    struct tls_credentials *credentials; // that nobody has taken yet, or NULL
};

// ---- applications -------------------------------------------------------------------------------

static int64_t run_application(void *data);
static void finish_application(void *data, bool done);

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
    }
    pthread_mutex_unlock(&r->lock);
    if (a)
        CHECK(task_pool_add(
            r->tasks,
            &(struct pool_task){.run = run_application, .finish = finish_application, .data = a}));
    return a != NULL;
}

void registrar_withdraw(struct registrar *r, const struct peer *applicant) {
    pthread_mutex_lock(&r->lock);
    for (int i = 0; i < REGISTRAR_APPLICANTS_MAX; i++) {
        struct application *a = &r->applications[i];
        if (a->state == FREE || a->applicant != applicant)
            continue;
        a->applicant = NULL;
        if (a->state == ANSWERED)
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
static void refuse_enrolment(enum result result, const struct error *err,
                             arthron_Control *out_answer) {
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

static bool is_withdrawn(const struct application *a) {
    pthread_mutex_lock(&a->registrar->lock);
    bool withdrawn = !a->applicant;
    pthread_mutex_unlock(&a->registrar->lock);
    return withdrawn;
}

// Again where another process holds the keys.
static int64_t run_application(void *data) {
    struct application *a = data;
    struct authority_answer answer;
    struct error err;
    if (is_withdrawn(a))
        return TASK_DONE;
    enum result result = ask_authority(a->registrar->dir, a, &answer, &err);
    if (result == RESULT_TIMEOUT)
        return RETRY_NS;
    if (result == RESULT_OK)
        fill_enrolled(&answer, &a->answer);
    else
        refuse_enrolment(result, &err, &a->answer);
    return TASK_DONE;
}

static void finish_application(void *data, bool done) {
    struct application *a = data;
    struct registrar *r = a->registrar;
    pthread_mutex_lock(&r->lock);
    a->state = done && a->applicant ? ANSWERED : FREE;
    bool answered = a->state == ANSWERED;
    pthread_mutex_unlock(&r->lock);
    if (answered)
        r->on_news(r->user);
}

// ---- certificates in use ------------------------------------------------------------------------

struct tls_credentials *registrar_take_credentials(struct registrar *r) {
    pthread_mutex_lock(&r->lock);
    struct tls_credentials *credentials = r->credentials;
    r->credentials = NULL;
    pthread_mutex_unlock(&r->lock);
    return credentials;
}

// Again where another process holds the keys.
static int64_t run_revocation(void *data) {
    const struct used_certificate *used = data;
    const struct identity *identity = &used->identity;
    int revoked;
    struct error err;
    enum result result =
        authority_used(used->registrar->dir, identity->name, identity->serial, &revoked, &err);
    if (result == RESULT_TIMEOUT)
        return RETRY_NS;
    if (result != RESULT_OK)
        log_error("control", "station %s: its older certificates cannot be revoked: %s",
                  identity->name, err.text);
    else if (revoked)
        log_info("control", "station %s uses a new certificate; its older ones are revoked (%d)",
                 identity->name, revoked);
    return TASK_DONE;
}

static void forget_used(void *data, bool done) {
    (void)done;
    struct used_certificate *used = data;
    pthread_mutex_lock(&used->registrar->lock);
    used->waits = false;
    pthread_mutex_unlock(&used->registrar->lock);
}

void registrar_used(struct registrar *r, const struct identity *identity) {
    struct used_certificate *used = NULL;
    pthread_mutex_lock(&r->lock);
    for (int i = 0; i < USED_MAX && !used; i++)
        if (!r->used[i].waits)
            used = &r->used[i];
    if (used)
        *used = (struct used_certificate){r, true, *identity};
    pthread_mutex_unlock(&r->lock);
    if (used)
        CHECK(task_pool_add(
            r->tasks,
            &(struct pool_task){.run = run_revocation, .finish = forget_used, .data = used}));
    else
        log_warning("control",
                    "station %s: older certificates of it stay good until it connects again",
                    identity->name);
}

// ---- the authority's files ----------------------------------------------------------------------

// As an operator would; the next look takes the new certificate. Where it fails, the log says why,
// and tls_files_warn what to do.
static bool renew_in_time(struct registrar *r) {
    struct authority_server renewed;
    struct error err;
    int64_t now_s = clock_utc_ns() / NS_PER_S;
    if (tls_files_end_s(r->tls_files) - now_s >= RENEWAL_S ||
        (r->renewed_s && now_s - r->renewed_s < RENEWAL_RETRY_S))
        return false;
    r->renewed_s = now_s;
    enum result result = authority_renew_server(r->dir, NULL, 0, &renewed, &err);
    if (result != RESULT_OK)
        log_warning("control", "the server's certificate cannot be renewed: %s", err.text);
    return result == RESULT_OK;
}

static int64_t look_at_files(void *data) {
    struct registrar *r = data;
    struct revocations *before = r->revocations, *now = revocations_read(r->dir, before);
    struct tls_credentials *credentials = tls_files_look(r->tls_files);
    if (credentials)
        log_info("control", "the server's certificate was renewed");
    if (!renew_in_time(r))
        tls_files_warn(r->tls_files, "control", r->advice);
    pthread_mutex_lock(&r->lock);
    if (now) {
        r->revocations = now;
        r->is_new = true;
        revocations_release(&before);
    }
    if (credentials) {
        tls_credentials_destroy(&r->credentials);
        r->credentials = credentials;
    }
    pthread_mutex_unlock(&r->lock);
    if (credentials || now)
        r->on_news(r->user);
    return LOOK_NS;
}

// ---- life ---------------------------------------------------------------------------------------

bool registrar_is_revoked(struct registrar *r, const char *serial_hex) {
    pthread_mutex_lock(&r->lock);
    bool revoked = revocations_contain(r->revocations, serial_hex);
    pthread_mutex_unlock(&r->lock);
    return revoked;
}

bool registrar_take_revoked(struct registrar *r) {
    pthread_mutex_lock(&r->lock);
    bool is_new = r->is_new;
    r->is_new = false;
    pthread_mutex_unlock(&r->lock);
    return is_new;
}

struct registrar *registrar_create(const char *authority_dir, struct tls_files *tls_files,
                                   void (*on_news)(void *user), void *user) {
    struct registrar *r = alloc(1, sizeof *r);
    r->dir = alloc_text(authority_dir);
    r->tls_files = tls_files;
    snprintf(r->advice, sizeof r->advice, "run arthron-server keys renew %s", authority_dir);
    r->on_news = on_news;
    r->user = user;
    r->revocations = revocations_read(authority_dir, NULL);
    pthread_mutex_init(&r->lock, NULL);
    for (int i = 0; i < REGISTRAR_APPLICANTS_MAX; i++)
        r->applications[i].registrar = r;
    r->tasks = task_pool_create(&(struct task_pool_settings){.threads = 1, .tasks_max = TASKS_MAX});
    CHECK(task_pool_add(r->tasks, &(struct pool_task){.run = look_at_files, .data = r}));
    return r;
}

void registrar_destroy(struct registrar **registrar) {
    struct registrar *r = *registrar;
    task_pool_destroy(&r->tasks);
    pthread_mutex_destroy(&r->lock);
    revocations_release(&r->revocations);
    tls_credentials_destroy(&r->credentials);
    tls_files_destroy(&r->tls_files);
    free(r->dir);
    free(r);
    *registrar = NULL;
}
