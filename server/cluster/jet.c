#include "cluster/jet.h"

#include "base/check.h"
#include "base/log.h"
#include "base/password_file.h"

#include <ctype.h>
#include <errno.h>
#include <inttypes.h>
#include <nats/nats.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define BUCKET "arthron-lease"
#define JOURNAL_STREAM "arthron-journal"
#define RECORDS_STREAM "arthron-records"
#define ANSWER_MS 2000
#define SEND_MS 1000 // until NATS, which takes nothing, counts as away
#define CONNECT_MS 1500
#define PATIENCE_MS 5000 // of questions that wait
#define RECONNECT_MS 250
#define PING_MS 2000
#define WATCH_MS 500         // the thread looks so often whether it is to end
#define WATCH_SILENT_MS 8000 // own renewals are seen more often: a watch that shows none is dead
#define PENDING_MOST 65536
#define LEFT_AT_ONCE 4 // a consumer of NATS is removed for each, while nobody watches

// What nobody reads any more. The library's reading thread may hold it still, and does not tell
// (libnats before 3.6.1): it is freed once that thread has read on, or has ended.
struct left {
    struct left *next;
    natsSubscription *sub; // NULL: it is a watcher
    kvWatcher *watcher;
    bool is_stopped; // when the thread had read on once: a ping that could not be sent looks
                     // answered
};

struct jet {
    struct jet_settings settings;
    struct jet_handler handler;
    natsOptions *options;
    natsConnection *connection;
    jsCtx *js;
    pthread_t thread;
    bool has_thread;
    atomic_bool ends, is_connected, anew; // anew: the watch has to begin again
    atomic_uint generation;
    sem_t closed; // the connection's last word
    pthread_mutex_t left_lock;
    struct left *left;
};

// ---- names --------------------------------------------------------------------------------------

void jet_token(const char *name, char out[JET_TOKEN_SIZE]) {
    size_t used = 0;
    for (; *name && used + 4 < JET_TOKEN_SIZE; name++) {
        bool plain = isalnum((unsigned char)*name) || *name == '-' || *name == '_';
        used += (size_t)sprintf(out + used, plain ? "%c" : "=%02X", (unsigned char)*name);
    }
    out[used] = '\0';
}

bool jet_name(const char *token, char out[SERVER_NAME_SIZE]) {
    size_t used = 0;
    for (; *token && used + 1 < SERVER_NAME_SIZE; used++) {
        bool plain = *token != '=';
        unsigned value = (unsigned char)*token;
        if (!plain && (!isxdigit((unsigned char)token[1]) || !isxdigit((unsigned char)token[2]) ||
                       sscanf(token + 1, "%2X", &value) != 1))
            return false;
        token += plain ? 1 : 3;
        out[used] = (char)value;
    }
    out[used] = '\0';
    return !*token && used;
}

// ---- answers ------------------------------------------------------------------------------------

static uint64_t number_of(natsMsg *message, const char *header) {
    const char *text = NULL;
    if (natsMsgHeader_Get(message, header, &text) != NATS_OK || !text)
        return 0;
    return strtoull(text, NULL, 10);
}

static void on_answer(jsCtx *js, natsMsg *message, jsPubAck *answer, jsPubAckErr *fault,
                      void *user) {
    (void)js;
    struct jet *jet = user;
    uint64_t id = number_of(message, "Arthron-Write");
    bool late = fault && fault->ErrCode == JSStreamWrongLastSequenceErr;
    if (answer)
        jet->handler.answered(jet->handler.user, id, WRITE_DONE, answer->Sequence);
    else
        jet->handler.answered(jet->handler.user, id, late ? WRITE_LATE : WRITE_UNKNOWN, 0);
    natsMsg_Destroy(message);
}

static void set_number(natsMsg *message, const char *header, uint64_t number) {
    char text[24];
    snprintf(text, sizeof text, "%" PRIu64, number);
    natsMsgHeader_Set(message, header, text);
}

// The message is the library's from here on, unless it refuses it.
static void send_message(struct jet *jet, uint64_t id, natsMsg *message) {
    jsPubOptions options;
    jsPubOptions_Init(&options);
    options.MaxWait = ANSWER_MS;
    set_number(message, "Arthron-Write", id);
    if (atomic_load(&jet->is_connected) &&
        js_PublishMsgAsync(jet->js, &message, &options) == NATS_OK)
        return;
    natsMsg_Destroy(message);
    jet->handler.answered(jet->handler.user, id, WRITE_UNKNOWN, 0);
}

void jet_write_key(struct jet *jet, uint64_t id, const char *key, uint64_t replaces,
                   const char *value) {
    char subject[JET_TEXT_SIZE + sizeof "$KV." BUCKET];
    natsMsg *message = NULL;
    snprintf(subject, sizeof subject, "$KV." BUCKET ".%s", key);
    natsStatus status = natsMsg_Create(&message, subject, NULL, value, (int)strlen(value));
    NEED(status == NATS_OK, "memory");
    set_number(message, "Nats-Expected-Last-Subject-Sequence", replaces);
    send_message(jet, id, message);
}

static const char *stream_of(const char *subject) {
    bool of_records = !strncmp(subject, JET_RECORDS, sizeof JET_RECORDS - 1);
    return of_records ? RECORDS_STREAM : JOURNAL_STREAM;
}

static natsMsg *pack(const struct jet_message *m) {
    char name[JET_TEXT_SIZE + 64];
    natsMsg *message = NULL;
    CHECK(m->size <= JET_PART_MAX);
    natsStatus status = natsMsg_Create(&message, m->subject, NULL, m->data, (int)m->size);
    NEED(status == NATS_OK, "memory");
    snprintf(name, sizeof name, "%s/%" PRIu64 "/%" PRIu64, m->subject, m->token, m->number);
    natsMsgHeader_Set(message, "Nats-Msg-Id", name);
    set_number(message, "Arthron-Token", m->token);
    set_number(message, "Arthron-Number", m->number);
    natsMsgHeader_Set(message, "Arthron-Kind", m->kind);
    return message;
}

struct jet_letter *jet_pack(const struct jet_message *message) {
    return (struct jet_letter *)pack(message);
}

void jet_send(struct jet *jet, uint64_t id, struct jet_letter *letter) {
    send_message(jet, id, (natsMsg *)letter);
}

static enum result fail_by(struct error *err, const char *subject, natsStatus status) {
    enum result result = status == NATS_NOT_FOUND ? RESULT_MISSING : RESULT_TIMEOUT;
    return fail(err, result, "%s: NATS: %s", subject, natsStatus_GetText(status));
}

enum result jet_publish_now(struct jet *jet, const struct jet_message *m, uint64_t *out_sequence,
                            struct error *err) {
    natsMsg *message = pack(m);
    jsPubAck *answer = NULL;
    natsStatus status = js_PublishMsg(&answer, jet->js, message, NULL, NULL);
    if (status == NATS_OK)
        *out_sequence = answer->Sequence;
    jsPubAck_Destroy(answer);
    natsMsg_Destroy(message);
    return status == NATS_OK ? RESULT_OK : fail_by(err, m->subject, status);
}

void jet_purge(struct jet *jet, const char *subject, uint64_t before) {
    char request[JET_TEXT_SIZE + 64], call[64];
    if (before == 1) // NATS would take that for all
        return;
    if (before)
        snprintf(request, sizeof request, "{\"filter\":\"%s\",\"seq\":%" PRIu64 "}", subject,
                 before);
    else
        snprintf(request, sizeof request, "{\"filter\":\"%s\"}", subject);
    snprintf(call, sizeof call, "$JS.API.STREAM.PURGE.%s", stream_of(subject));
    natsConnection_PublishRequest(jet->connection, call, "arthron.unheard", request,
                                  (int)strlen(request));
}

// ---- what is left behind ------------------------------------------------------------------------

static void keep_left(struct jet *jet, struct left *left) {
    pthread_mutex_lock(&jet->left_lock);
    left->next = jet->left;
    jet->left = left;
    pthread_mutex_unlock(&jet->left_lock);
}

static void leave_subject(struct jet *jet, natsSubscription *sub, kvWatcher *watcher) {
    struct left *left = alloc(1, sizeof *left);
    left->sub = sub;
    left->watcher = watcher;
    keep_left(jet, left);
}

static struct left *take_left(struct jet *jet, int most) {
    struct left *taken = NULL;
    pthread_mutex_lock(&jet->left_lock);
    for (struct left *left; most-- && (left = jet->left);) {
        jet->left = left->next;
        left->next = taken;
        taken = left;
    }
    pthread_mutex_unlock(&jet->left_lock);
    return taken;
}

static void free_left(struct left *left) {
    natsSubscription_Destroy(left->sub);
    kvWatcher_Destroy(left->watcher);
    free(left);
}

static void stop_left(struct left *left) {
    if (left->sub)
        natsSubscription_Unsubscribe(left->sub);
    else
        kvWatcher_Stop(left->watcher);
}

static bool goes_on(struct jet *jet) {
    return !atomic_load(&jet->ends) && !atomic_load(&jet->anew);
}

// The answer to a ping comes to the thread that reads: what it had before, it holds no more.
static bool has_read_on(struct jet *jet) {
    return goes_on(jet) && natsConnection_FlushTimeout(jet->connection, ANSWER_MS) == NATS_OK;
}

static void clear_left(struct jet *jet) {
    struct left *taken = take_left(jet, LEFT_AT_ONCE);
    if (!taken)
        return;
    for (struct left *left = taken; left && goes_on(jet); left = left->next)
        if (!left->is_stopped)
            stop_left(left);
    bool read_on = has_read_on(jet);
    for (struct left *next; taken; taken = next) {
        next = taken->next;
        if (read_on && taken->is_stopped) {
            free_left(taken);
            continue;
        }
        taken->is_stopped = read_on;
        keep_left(jet, taken);
    }
}

// ---- reading ------------------------------------------------------------------------------------

static const char *kind_of_message(natsMsg *message) {
    const char *kind = NULL;
    natsMsgHeader_Get(message, "Arthron-Kind", &kind);
    return kind ? kind : "";
}

static natsStatus last_sequence(struct jet *jet, const char *subject, uint64_t *out) {
    natsMsg *last = NULL;
    jsErrCode code = 0;
    natsStatus status = js_GetLastMsg(&last, jet->js, stream_of(subject), subject, NULL, &code);
    if (status == NATS_OK)
        *out = natsMsg_GetSequence(last);
    natsMsg_Destroy(last);
    return code == JSNoMessageFoundErr ? NATS_NOT_FOUND : status;
}

// The data live as long as the message, which the caller destroys.
static natsStatus next_message(natsSubscription *sub, const char *subject, int wait_ms,
                               natsMsg **out_message, struct jet_message *out,
                               uint64_t *out_sequence) {
    natsMsg *message = NULL;
    jsMsgMetaData *about = NULL;
    natsStatus status = natsSubscription_NextMsg(&message, sub, wait_ms);
    if (status == NATS_OK)
        status = natsMsg_GetMetaData(&about, message);
    if (status != NATS_OK) {
        natsMsg_Destroy(message);
        return status;
    }
    *out_sequence = about->Sequence.Stream;
    *out = (struct jet_message){
        .subject = subject,
        .token = number_of(message, "Arthron-Token"),
        .number = number_of(message, "Arthron-Number"),
        .kind = kind_of_message(message),
        .data = natsMsg_GetData(message),
        .size = (size_t)natsMsg_GetDataLength(message),
    };
    jsMsgMetaData_Destroy(about);
    *out_message = message;
    return NATS_OK;
}

static natsStatus read_messages(natsSubscription *sub, const char *subject, uint64_t until,
                                bool (*take)(void *user, const struct jet_message *message,
                                             uint64_t sequence),
                                void *user) {
    for (uint64_t sequence = 0; sequence < until;) {
        natsMsg *message = NULL;
        struct jet_message one;
        natsStatus status = next_message(sub, subject, PATIENCE_MS, &message, &one, &sequence);
        if (status != NATS_OK)
            return status;
        bool more = sequence > until || take(user, &one, sequence);
        natsMsg_Destroy(message);
        if (!more)
            return NATS_OK;
    }
    return NATS_OK;
}

enum result jet_read(struct jet *jet, const char *subject, uint64_t until,
                     bool (*take)(void *user, const struct jet_message *message, uint64_t sequence),
                     void *user, struct error *err) {
    natsSubscription *sub = NULL;
    jsSubOptions options;
    jsSubOptions_Init(&options);
    options.Ordered = true;
    options.Stream = JOURNAL_STREAM;
    natsStatus status = NATS_OK;
    if (!until)
        status = last_sequence(jet, subject, &until);
    if (status == NATS_OK)
        status = js_SubscribeSync(&sub, jet->js, subject, NULL, &options, NULL);
    if (status == NATS_OK)
        status = read_messages(sub, subject, until, take, user);
    if (sub)
        leave_subject(jet, sub, NULL);
    return status == NATS_OK ? RESULT_OK : fail_by(err, subject, status);
}

// ---- following ----------------------------------------------------------------------------------

struct jet_follower {
    struct jet *jet;
    natsSubscription *sub;
    natsMsg *message; // whose data were given out
    char subject[];
};

enum result jet_follow(struct jet *jet, const char *subject, uint64_t from,
                       struct jet_follower **out_follower, struct error *err) {
    size_t length = strlen(subject) + 1;
    struct jet_follower *follower = alloc(1, sizeof *follower + length);
    jsSubOptions options;
    follower->jet = jet;
    memcpy(follower->subject, subject, length);
    jsSubOptions_Init(&options);
    options.Ordered = true;
    options.Stream = stream_of(subject);
    options.Config.DeliverPolicy = js_DeliverByStartSequence;
    options.Config.OptStartSeq = from;
    natsStatus status = js_SubscribeSync(&follower->sub, jet->js, subject, NULL, &options, NULL);
    if (status != NATS_OK)
        jet_follow_end(&follower);
    *out_follower = follower;
    return status == NATS_OK ? RESULT_OK : fail_by(err, subject, status);
}

enum result jet_follow_next(struct jet_follower *follower, int wait_ms, struct jet_message *out,
                            uint64_t *out_sequence, struct error *err) {
    natsMsg_Destroy(follower->message);
    follower->message = NULL;
    natsStatus status = next_message(follower->sub, follower->subject, wait_ms, &follower->message,
                                     out, out_sequence);
    if (status == NATS_TIMEOUT)
        return RESULT_MISSING;
    return status == NATS_OK ? RESULT_OK : fail_by(err, follower->subject, status);
}

void jet_follow_end(struct jet_follower **follower) {
    if (!*follower)
        return;
    natsMsg_Destroy((*follower)->message);
    if ((*follower)->sub)
        leave_subject((*follower)->jet, (*follower)->sub, NULL);
    free(*follower);
    *follower = NULL;
}

static enum result erase_one(struct jet *jet, const char *subject, uint64_t sequence,
                             struct error *err) {
    natsStatus status = js_EraseMsg(jet->js, stream_of(subject), sequence, NULL, NULL);
    return status == NATS_OK || status == NATS_NOT_FOUND ? RESULT_OK
                                                         : fail_by(err, subject, status);
}

enum result jet_erase(struct jet *jet, const char *subject, uint64_t before, struct error *err) {
    struct jet_follower *follower;
    struct jet_message message;
    uint64_t sequence = 0, last = 0;
    natsStatus status = last_sequence(jet, subject, &last);
    if (status != NATS_OK)
        return status == NATS_NOT_FOUND ? RESULT_OK : fail_by(err, subject, status);
    enum result result = jet_follow(jet, subject, 1, &follower, err);
    while (result == RESULT_OK && sequence < last) {
        result = jet_follow_next(follower, ANSWER_MS, &message, &sequence, err);
        if (result == RESULT_MISSING)
            result = fail(err, RESULT_TIMEOUT, "%s: NATS does not tell what is there", subject);
        if (result != RESULT_OK || sequence >= before)
            break;
        result = erase_one(jet, subject, sequence, err);
    }
    jet_follow_end(&follower);
    return result;
}

unsigned jet_generation(const struct jet *jet) {
    return atomic_load(&jet->generation);
}

enum result jet_last_of_records(struct jet *jet, uint64_t *out_sequence, struct error *err) {
    jsStreamInfo *info = NULL;
    natsStatus status = js_GetStreamInfo(&info, jet->js, RECORDS_STREAM, NULL, NULL);
    if (status == NATS_OK)
        *out_sequence = info->State.LastSeq;
    jsStreamInfo_Destroy(info);
    return status == NATS_OK ? RESULT_OK : fail_by(err, RECORDS_STREAM, status);
}

// ---- the streams --------------------------------------------------------------------------------

static natsStatus make_stream(struct jet *jet, const char *name, const char *subjects) {
    jsStreamConfig config;
    jsErrCode code = 0;
    jsStreamConfig_Init(&config);
    config.Name = name;
    config.Subjects = &subjects;
    config.SubjectsLen = 1;
    config.Replicas = jet->settings.replicas;
    config.Storage = js_FileStorage;
    natsStatus status = js_AddStream(NULL, jet->js, &config, NULL, &code);
    return code == JSStreamNameExistErr ? NATS_OK : status;
}

static natsStatus open_bucket(struct jet *jet, kvStore **out) {
    kvConfig config;
    natsStatus status = js_KeyValue(out, jet->js, BUCKET);
    if (status != NATS_NOT_FOUND)
        return status;
    kvConfig_Init(&config);
    config.Bucket = BUCKET;
    config.History = 1;
    config.Replicas = jet->settings.replicas;
    config.StorageType = js_FileStorage;
    return js_CreateKeyValue(out, jet->js, &config);
}

static natsStatus make_all(struct jet *jet, kvStore **out_bucket) {
    natsStatus status = open_bucket(jet, out_bucket);
    if (status == NATS_OK)
        status = make_stream(jet, JOURNAL_STREAM, JET_JOURNAL "*");
    if (status == NATS_OK)
        status = make_stream(jet, RECORDS_STREAM, JET_RECORDS "*");
    return status;
}

// ---- keys, at once ------------------------------------------------------------------------------

enum result jet_read_key(struct jet *jet, const char *key, char *out_value, size_t size,
                         uint64_t *out_revision, struct error *err) {
    kvStore *bucket = NULL;
    kvEntry *entry = NULL;
    enum result result = RESULT_OK;
    natsStatus status = make_all(jet, &bucket);
    if (status == NATS_OK)
        status = kvStore_Get(&entry, bucket, key);
    if (status == NATS_OK) {
        *out_revision = kvEntry_Revision(entry);
        int length = snprintf(out_value, size, "%.*s", kvEntry_ValueLen(entry),
                              (const char *)kvEntry_Value(entry));
        if ((size_t)length >= size)
            result = fail(err, RESULT_LIMIT, "NATS: key %s: it is too long", key);
    } else {
        result = fail_by(err, key, status);
    }
    kvEntry_Destroy(entry);
    kvStore_Destroy(bucket);
    return result;
}

enum result jet_replace_key(struct jet *jet, const char *key, uint64_t replaces, const char *value,
                            struct error *err) {
    kvStore *bucket = NULL;
    uint64_t revision;
    natsStatus status = open_bucket(jet, &bucket);
    bool reached = status == NATS_OK;
    if (reached)
        status = replaces ? kvStore_UpdateString(&revision, bucket, key, value, replaces)
                          : kvStore_CreateString(&revision, bucket, key, value);
    kvStore_Destroy(bucket);
    if (reached && status == NATS_ERR)
        return fail(err, RESULT_REFUSED, "NATS: key %s: another server has changed it", key);
    return status == NATS_OK ? RESULT_OK : fail_by(err, key, status);
}

// ---- the watch ----------------------------------------------------------------------------------

// NATS forgets a watch that was cut off for some seconds, and does not say so.
static void watch(struct jet *jet, kvWatcher *watcher) {
    int silent_ms = 0;
    while (goes_on(jet) && silent_ms < WATCH_SILENT_MS) {
        kvEntry *entry = NULL;
        clear_left(jet);
        natsStatus status = kvWatcher_Next(&entry, watcher, WATCH_MS);
        silent_ms = status == NATS_OK ? 0 : silent_ms + WATCH_MS;
        if (status != NATS_OK && status != NATS_TIMEOUT)
            return;
        if (entry)
            jet->handler.saw(jet->handler.user, kvEntry_Key(entry), kvEntry_Value(entry),
                             (size_t)kvEntry_ValueLen(entry), kvEntry_Revision(entry));
        kvEntry_Destroy(entry);
    }
}

static void watch_once(struct jet *jet) {
    kvStore *bucket = NULL;
    kvWatcher *watcher = NULL;
    atomic_store(&jet->anew, false);
    natsStatus status = make_all(jet, &bucket);
    if (status == NATS_OK)
        status = kvStore_WatchAll(&watcher, bucket, NULL);
    if (status == NATS_OK)
        watch(jet, watcher);
    else if (atomic_load(&jet->is_connected))
        log_warning("cluster", "NATS: streams and keys: %s", natsStatus_GetText(status));
    if (watcher)
        leave_subject(jet, NULL, watcher);
    kvStore_Destroy(bucket);
}

static void *serve(void *argument) {
    struct jet *jet = argument;
    while (!atomic_load(&jet->ends)) {
        if (natsConnection_Status(jet->connection) == NATS_CONN_STATUS_CONNECTED)
            watch_once(jet);
        usleep(100000);
    }
    return NULL;
}

// ---- the connection -----------------------------------------------------------------------------

static void tell_connected(struct jet *jet, bool is_connected) {
    atomic_store(&jet->anew, true);
    atomic_fetch_add(&jet->generation, 1);
    if (atomic_exchange(&jet->is_connected, is_connected) != is_connected)
        jet->handler.connected(jet->handler.user, is_connected);
}

static void on_nats_connected(natsConnection *connection, void *user) {
    (void)connection;
    tell_connected(user, true);
}

static void on_disconnected(natsConnection *connection, void *user) {
    (void)connection;
    tell_connected(user, false);
}

static void on_closed(natsConnection *connection, void *user) {
    (void)connection;
    sem_post(&((struct jet *)user)->closed);
}

static void on_fault(natsConnection *connection, natsSubscription *sub, natsStatus status,
                     void *user) {
    (void)connection, (void)sub;
    struct jet *jet = user;
    atomic_store(&jet->anew, true);
    log_debug("cluster", "NATS: %s", natsStatus_GetText(status));
}

static natsStatus set_trust(struct jet *jet) {
    const struct jet_settings *c = &jet->settings;
    natsStatus status = NATS_OK;
    if (c->authority[0])
        status = natsOptions_LoadCATrustedCertificates(jet->options, c->authority);
    if (status == NATS_OK && c->certificate[0])
        status = natsOptions_LoadCertificatesChain(jet->options, c->certificate, c->key);
    if (status == NATS_OK && (c->authority[0] || c->certificate[0]))
        status = natsOptions_SetSecure(jet->options, true);
    return status;
}

// What cannot be sent at once fails: it is never sent later, unasked.
static natsStatus set_options(struct jet *jet) {
    natsOptions *o = jet->options;
    const char *servers[JET_SERVERS_MAX];
    for (int i = 0; i < jet->settings.server_count; i++)
        servers[i] = jet->settings.servers[i];
    natsStatus all[] = {
        natsOptions_SetServers(o, servers, jet->settings.server_count),
        natsOptions_SetName(o, jet->settings.name),
        natsOptions_SetMaxReconnect(o, -1),
        natsOptions_SetReconnectWait(o, RECONNECT_MS),
        natsOptions_SetReconnectBufSize(o, 1),
        natsOptions_SetPingInterval(o, PING_MS),
        natsOptions_SetMaxPingsOut(o, 2),
        natsOptions_SetTimeout(o, CONNECT_MS),
        natsOptions_SetWriteDeadline(o, SEND_MS),
        natsOptions_SetRetryOnFailedConnect(o, true, on_nats_connected, jet),
        natsOptions_SetReconnectedCB(o, on_nats_connected, jet),
        natsOptions_SetDisconnectedCB(o, on_disconnected, jet),
        natsOptions_SetClosedCB(o, on_closed, jet),
        natsOptions_SetErrorHandler(o, on_fault, jet),
    };
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        if (all[i] != NATS_OK)
            return all[i];
    return NATS_OK;
}

static enum result set_user(struct jet *jet, struct error *err) {
    char password[JET_TEXT_SIZE] = "";
    const struct jet_settings *c = &jet->settings;
    if (!c->user[0])
        return RESULT_OK;
    enum result result =
        c->password[0] ? password_file_read(c->password, "NATS", password, sizeof password, err)
                       : RESULT_OK;
    if (result == RESULT_OK)
        natsOptions_SetUserInfo(jet->options, c->user, password);
    explicit_bzero(password, sizeof password);
    return result;
}

static enum result connect_to(struct jet *jet, struct error *err) {
    jsOptions options;
    natsStatus status = natsConnection_Connect(&jet->connection, jet->options);
    if (status != NATS_OK && status != NATS_NOT_YET_CONNECTED)
        return fail(err, RESULT_INVALID, "NATS: %s", nats_GetLastError(NULL));
    jsOptions_Init(&options);
    options.Wait = PATIENCE_MS;
    options.PublishAsync.MaxPending = PENDING_MOST;
    options.PublishAsync.AckHandler = on_answer;
    options.PublishAsync.AckHandlerClosure = jet;
    natsStatus made = natsConnection_JetStream(&jet->js, jet->connection, &options);
    if (made != NATS_OK)
        return fail(err, RESULT_INVALID, "NATS: JetStream: %s", natsStatus_GetText(made));
    if (status == NATS_OK)
        tell_connected(jet, true);
    return RESULT_OK;
}

// Connected to nothing yet. Destroy it after an error too.
static enum result prepare(const struct jet_settings *settings, const struct jet_handler *handler,
                           struct jet **out_jet, struct error *err) {
    struct jet *jet = *out_jet = alloc(1, sizeof *jet);
    jet->settings = *settings;
    jet->handler = *handler;
    sem_init(&jet->closed, 0, 0);
    pthread_mutex_init(&jet->left_lock, NULL);
    natsStatus status = natsOptions_Create(&jet->options);
    if (status == NATS_OK)
        status = set_options(jet);
    if (status == NATS_OK)
        status = set_trust(jet);
    return status == NATS_OK ? set_user(jet, err)
                             : fail(err, RESULT_INVALID, "NATS: %s", nats_GetLastError(NULL));
}

enum result jet_create(const struct jet_settings *settings, const struct jet_handler *handler,
                       struct jet **out_jet, struct error *err) {
    struct jet *jet;
    enum result result = prepare(settings, handler, &jet, err);
    if (result == RESULT_OK)
        result = connect_to(jet, err);
    if (result == RESULT_OK) {
        int failed = pthread_create(&jet->thread, NULL, serve, jet);
        NEED(!failed, "thread");
        jet->has_thread = true;
    } else {
        jet_destroy(&jet);
    }
    *out_jet = jet;
    return result;
}

// The library gives them on a thread that nothing else waits for.
static void wait_for_answers(struct jet *jet) {
    jsPubOptions options;
    jsPubOptions_Init(&options);
    options.MaxWait = ANSWER_MS + SEND_MS;
    js_PublishAsyncComplete(jet->js, &options);
}

void jet_destroy(struct jet **jet) {
    struct jet *j = *jet;
    if (!j)
        return;
    atomic_store(&j->ends, true);
    if (j->has_thread)
        pthread_join(j->thread, NULL);
    if (j->js)
        wait_for_answers(j);
    if (j->connection) {
        natsConnection_Close(j->connection);
        while (sem_wait(&j->closed) && errno == EINTR)
            ;
    }
    for (struct left *left; (left = take_left(j, 1)) != NULL;)
        free_left(left);
    jsCtx_Destroy(j->js);
    natsConnection_Destroy(j->connection);
    natsOptions_Destroy(j->options);
    sem_destroy(&j->closed);
    pthread_mutex_destroy(&j->left_lock);
    free(j);
    *jet = NULL;
}

// A library that is closed frees at the process's end what OpenSSL frees there, too: it is opened
// again.
void jet_end_library(void) {
    if (nats_CloseAndWait(ANSWER_MS) == NATS_OK)
        nats_Open(-1);
}

// ---- a look -------------------------------------------------------------------------------------

static void ignore(void *user, bool is_connected) {
    (void)user, (void)is_connected;
}

// An entry that is none comes behind the last that is there.
static natsStatus
take_keys(kvWatcher *watcher,
          void (*take)(void *user, const char *key, const char *value, size_t size), void *user) {
    for (;;) {
        kvEntry *entry = NULL;
        natsStatus status = kvWatcher_Next(&entry, watcher, PATIENCE_MS);
        if (status != NATS_OK || !entry)
            return status;
        take(user, kvEntry_Key(entry), kvEntry_Value(entry), (size_t)kvEntry_ValueLen(entry));
        kvEntry_Destroy(entry);
    }
}

enum result jet_look(const struct jet_settings *settings,
                     void (*take)(void *user, const char *key, const char *value, size_t size),
                     void *user, struct error *err) {
    const struct jet_handler handler = {.connected = ignore};
    struct jet *jet;
    kvStore *bucket = NULL;
    kvWatcher *watcher = NULL;
    enum result result = prepare(settings, &handler, &jet, err);
    if (result == RESULT_OK) {
        natsOptions_SetRetryOnFailedConnect(jet->options, false, NULL, NULL);
        result = connect_to(jet, err);
    }
    if (result == RESULT_OK) {
        natsStatus status = js_KeyValue(&bucket, jet->js, BUCKET);
        bool is_new = status == NATS_NOT_FOUND;
        if (status == NATS_OK)
            status = kvStore_WatchAll(&watcher, bucket, NULL);
        if (status == NATS_OK)
            status = take_keys(watcher, take, user);
        if (status != NATS_OK && !is_new)
            result = fail(err, RESULT_TIMEOUT, "NATS: %s", natsStatus_GetText(status));
    }
    if (watcher)
        leave_subject(jet, NULL, watcher);
    kvStore_Destroy(bucket);
    jet_destroy(&jet);
    return result;
}
