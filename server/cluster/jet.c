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
#define ANSWER_MS 2000
#define PATIENCE_MS 5000 // of questions that wait
#define RECONNECT_MS 250
#define PING_MS 2000
#define WATCH_MS 500         // the thread looks so often whether it is to end
#define WATCH_SILENT_MS 8000 // own renewals are seen more often: a watch that shows none is dead
#define PENDING_MOST 65536

struct jet {
    struct jet_settings settings;
    struct jet_handler handler;
    natsOptions *options;
    natsConnection *connection;
    jsCtx *js;
    pthread_t thread;
    bool has_thread;
    atomic_bool ends, is_connected, anew; // anew: the watch has to begin again
    sem_t closed;                         // the connection's last word
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

void jet_publish(struct jet *jet, uint64_t id, const struct jet_message *m) {
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
    send_message(jet, id, message);
}

void jet_purge(struct jet *jet, const char *subject, uint64_t before) {
    char request[JET_TEXT_SIZE + 64];
    if (before == 1) // NATS would take that for all
        return;
    if (before)
        snprintf(request, sizeof request, "{\"filter\":\"%s\",\"seq\":%" PRIu64 "}", subject,
                 before);
    else
        snprintf(request, sizeof request, "{\"filter\":\"%s\"}", subject);
    natsConnection_PublishRequest(jet->connection, "$JS.API.STREAM.PURGE." JOURNAL_STREAM,
                                  "arthron.unheard", request, (int)strlen(request));
}

// ---- reading ------------------------------------------------------------------------------------

static const char *kind_of(natsMsg *message) {
    const char *kind = NULL;
    natsMsgHeader_Get(message, "Arthron-Kind", &kind);
    return kind ? kind : "";
}

static natsStatus last_sequence(struct jet *jet, const char *subject, uint64_t *out) {
    natsMsg *last = NULL;
    jsErrCode code = 0;
    natsStatus status = js_GetLastMsg(&last, jet->js, JOURNAL_STREAM, subject, NULL, &code);
    if (status == NATS_OK)
        *out = natsMsg_GetSequence(last);
    natsMsg_Destroy(last);
    return code == JSNoMessageFoundErr ? NATS_NOT_FOUND : status;
}

static natsStatus read_messages(natsSubscription *sub, const char *subject, uint64_t until,
                                bool (*take)(void *user, const struct jet_message *message,
                                             uint64_t sequence),
                                void *user) {
    for (uint64_t sequence = 0; sequence < until;) {
        natsMsg *message = NULL;
        jsMsgMetaData *about = NULL;
        natsStatus status = natsSubscription_NextMsg(&message, sub, PATIENCE_MS);
        if (status == NATS_OK)
            status = natsMsg_GetMetaData(&about, message);
        if (status != NATS_OK) {
            natsMsg_Destroy(message);
            return status;
        }
        sequence = about->Sequence.Stream;
        struct jet_message one = {
            .subject = subject,
            .token = number_of(message, "Arthron-Token"),
            .number = number_of(message, "Arthron-Number"),
            .kind = kind_of(message),
            .data = natsMsg_GetData(message),
            .size = (size_t)natsMsg_GetDataLength(message),
        };
        bool more = sequence > until || take(user, &one, sequence);
        jsMsgMetaData_Destroy(about);
        natsMsg_Destroy(message);
        if (!more)
            return NATS_OK;
    }
    return NATS_OK;
}

static enum result fail_by(struct error *err, const char *subject, natsStatus status) {
    enum result result = status == NATS_NOT_FOUND ? RESULT_MISSING : RESULT_TIMEOUT;
    return fail(err, result, "%s: NATS: %s", subject, natsStatus_GetText(status));
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
    natsSubscription_Destroy(sub);
    return status == NATS_OK ? RESULT_OK : fail_by(err, subject, status);
}

// ---- the streams --------------------------------------------------------------------------------

static natsStatus make_stream(struct jet *jet) {
    const char *subjects = JET_JOURNAL "*";
    jsStreamConfig config;
    jsErrCode code = 0;
    jsStreamConfig_Init(&config);
    config.Name = JOURNAL_STREAM;
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
        status = make_stream(jet);
    return status;
}

// ---- the watch ----------------------------------------------------------------------------------

static bool goes_on(struct jet *jet) {
    return !atomic_load(&jet->ends) && !atomic_load(&jet->anew);
}

// NATS forgets a watch that was cut off for some seconds, and does not say so.
static void watch(struct jet *jet, kvWatcher *watcher) {
    int silent_ms = 0;
    while (goes_on(jet) && silent_ms < WATCH_SILENT_MS) {
        kvEntry *entry = NULL;
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
    kvWatcher_Destroy(watcher);
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

static void tell(struct jet *jet, bool is_connected) {
    atomic_store(&jet->anew, true);
    if (atomic_exchange(&jet->is_connected, is_connected) != is_connected)
        jet->handler.connected(jet->handler.user, is_connected);
}

static void on_connected(natsConnection *connection, void *user) {
    (void)connection;
    tell(user, true);
}

static void on_disconnected(natsConnection *connection, void *user) {
    (void)connection;
    tell(user, false);
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
        natsOptions_SetTimeout(o, PATIENCE_MS),
        natsOptions_SetRetryOnFailedConnect(o, true, on_connected, jet),
        natsOptions_SetReconnectedCB(o, on_connected, jet),
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
        tell(jet, true);
    return RESULT_OK;
}

enum result jet_create(const struct jet_settings *settings, const struct jet_handler *handler,
                       struct jet **out_jet, struct error *err) {
    struct jet *jet = alloc(1, sizeof *jet);
    jet->settings = *settings;
    jet->handler = *handler;
    sem_init(&jet->closed, 0, 0);
    natsStatus status = natsOptions_Create(&jet->options);
    if (status == NATS_OK)
        status = set_options(jet);
    if (status == NATS_OK)
        status = set_trust(jet);
    enum result result = status == NATS_OK
                             ? set_user(jet, err)
                             : fail(err, RESULT_INVALID, "NATS: %s", nats_GetLastError(NULL));
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

void jet_destroy(struct jet **jet) {
    struct jet *j = *jet;
    if (!j)
        return;
    atomic_store(&j->ends, true);
    if (j->has_thread)
        pthread_join(j->thread, NULL);
    if (j->connection) {
        natsConnection_Close(j->connection);
        while (sem_wait(&j->closed) && errno == EINTR)
            ;
    }
    jsCtx_Destroy(j->js);
    natsConnection_Destroy(j->connection);
    natsOptions_Destroy(j->options);
    sem_destroy(&j->closed);
    free(j);
    *jet = NULL;
}
