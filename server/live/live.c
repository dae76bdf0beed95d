#include "live/live.h"

#include "base/check.h"
#include "base/clock.h"
#include "live/playback.h"
#include "live/viewer.h"
#include "runtime/reply.h"
#include "sessions/fork.h"
#include "trace/catalogue.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define IDLE_NS NS_PER_S

// ---- batches ------------------------------------------------------------------------------------

bool batch_put(struct live_batch *b, const void *items, size_t size) {
    if (size > b->size - b->used) {
        b->full = true;
        return false;
    }
    memcpy(b->bytes + b->used, items, size);
    b->used += size;
    return true;
}

bool batch_say(struct live_batch *b, const arthron_Live *item) {
    size_t used;
    if (live_encode(item, b->bytes + b->used, b->size - b->used, &used) != RESULT_OK) {
        b->full = true;
        return false;
    }
    b->used += used;
    return true;
}

uint32_t chunk_count(const struct mesh_payload *payload) {
    return (uint32_t)((payload->size + WIRE_CHUNK_DATA - 1) / WIRE_CHUNK_DATA);
}

bool chunk_say(const struct mesh_payload *payload, uint32_t index, arthron_MeshChunk *chunk,
               struct live_batch *b) {
    size_t at = (size_t)index * WIRE_CHUNK_DATA, left = payload->size - at, used;
    chunk->base = payload->base;
    chunk->number = payload->number;
    chunk->size = (uint32_t)payload->size;
    chunk->hash = payload->hash;
    chunk->index = index;
    chunk->mismatch_size = (uint32_t)payload->mismatch_size;
    chunk->data.size = (pb_size_t)(left < WIRE_CHUNK_DATA ? left : WIRE_CHUNK_DATA);
    memcpy(chunk->group, payload->group, sizeof chunk->group);
    memcpy(chunk->data.bytes, payload->bytes + at, chunk->data.size);
    if (live_encode_chunk(chunk, b->bytes + b->used, b->size - b->used, &used) != RESULT_OK) {
        b->full = true;
        return false;
    }
    b->used += used;
    return true;
}

struct parcel *parcel_of(const arthron_Live *item, uint32_t viewer_number) {
    struct parcel *parcel = alloc(1, sizeof *parcel + LIVE_ITEM_MAX);
    parcel->viewer_number = viewer_number;
    if (live_encode(item, parcel->bytes, LIVE_BATCH_MAX, &parcel->size) != RESULT_OK) {
        free(parcel);
        return NULL;
    }
    return alloc_resize(parcel, 1, sizeof *parcel + parcel->size);
}

static size_t station_count(const struct live_server *live) {
    return (size_t)sessions_config(live->sessions)->station_count;
}

// ---- viewers ------------------------------------------------------------------------------------

void viewer_trouble(struct viewer *viewer, arthron_Trouble_Kind kind, arthron_Why_Code code,
                    const char *parameter, const char *format, ...) {
    va_list args;
    viewer->trouble_kind = kind;
    reply_why(code, parameter, &viewer->trouble_why);
    va_start(args, format);
    vsnprintf(viewer->trouble, sizeof viewer->trouble, format, args);
    va_end(args);
}

// Answers to the viewer that used this slot before.
static void drop_answers(struct viewer *viewer) {
    struct parcel *parcel;
    while (ring_pop(viewer->answers, &parcel))
        free(parcel);
}

static bool has_room_for(const struct live_server *live, const struct live_account *account) {
    int own = 0, trainees = 0;
    for (int i = 0; i < LIVE_VIEWERS_MAX; i++) {
        const struct viewer *viewer = &live->viewers[i];
        own += viewer->used && is_same_person(&viewer->account, account);
        trainees += viewer->used && is_trainee(&viewer->account);
    }
    return is_trainee(account)
               ? own < LIVE_VIEWERS_OF_TRAINEE && trainees < LIVE_VIEWERS_OF_TRAINEES
               : own < LIVE_VIEWERS_OF_STAFF;
}

struct viewer *live_server_join(struct live_server *live, const struct live_account *account,
                                const char *token) {
    bool room = has_room_for(live, account);
    for (int i = 0; room && i < LIVE_VIEWERS_MAX; i++) {
        struct viewer *viewer = &live->viewers[i];
        if (viewer->used)
            continue;
        drop_answers(viewer);
        *viewer = (struct viewer){.used = true,
                                  .number = ++live->numbers,
                                  .account = *account,
                                  .role = ROLE_COUNT,
                                  .answers = viewer->answers,
                                  .sent = viewer->sent,
                                  .station = -1};
        elsewhere_init(live, viewer, token);
        store_role_from_name(account->role, &viewer->role);
        return viewer;
    }
    return NULL;
}

static void look_away(struct viewer *viewer) {
    follow_end(viewer);
    if (viewer->playback)
        playback_leave(&viewer->playback);
}

void live_server_leave(struct live_server *live, struct viewer *viewer) {
    (void)live;
    look_away(viewer);
    elsewhere_fini(viewer);
    answers_clear(&viewer->answers_due);
    viewer->used = false;
}

// ---- what a page says ---------------------------------------------------------------------------

static bool watch_station(struct live_server *live, struct viewer *viewer) {
    const arthron_Watch *watch = &viewer->watch;
    viewer->station = sessions_find_station(sessions_config(live->sessions), watch->station);
    if (viewer->station >= 0)
        return true;
    if (is_staff(viewer))
        viewer_trouble(viewer, arthron_Trouble_Kind_NOT_THERE, arthron_Why_Code_NO_STATION,
                       watch->station, "there is no station %s in the server's config",
                       watch->station);
    else
        follow_bar(viewer, watch->station);
    return false;
}

static bool watch_recorded(struct live_server *live, struct viewer *viewer) {
    if (turns_have_place(&live->turns, &viewer->account)) {
        viewer->playback = playback_create(live, viewer);
        playback_start(viewer->playback);
        return true;
    }
    viewer_trouble(viewer, arthron_Trouble_Kind_FAILED, arthron_Why_Code_TOO_MANY_RECORDS, NULL,
                   "you play as many recorded sessions as you may: close one of them");
    return false;
}

static void take_watch(struct live_server *live, struct viewer *viewer,
                       const arthron_Watch *watch) {
    look_away(viewer);
    viewer->watch = *watch;
    viewer->period_ns = snapshot_period_ns(watch);
    viewer->due_ns = 0;
    memset(viewer->sent, 0, station_count(live) * sizeof *viewer->sent);
    bool good = true;
    if (watch->what == arthron_Watch_What_WALL && !is_staff(viewer)) {
        viewer_trouble(viewer, arthron_Trouble_Kind_NOT_THERE, arthron_Why_Code_NOT_ALLOWED, NULL,
                       "the wall is for instructors and technicians");
        good = false;
    } else if (watch->what == arthron_Watch_What_STATION) {
        good = watch_station(live, viewer);
    } else if (watch->what == arthron_Watch_What_RECORDED) {
        good = watch_recorded(live, viewer);
    }
    if (!good)
        viewer->watch.what = arthron_Watch_What_NOTHING;
    elsewhere_watch(live, viewer);
}

// Who trains may practise: the sessions see to it that it is an own session.
static bool practises(const struct viewer *viewer, const arthron_Command *command) {
    return viewer->role == ROLE_TRAINEE && viewer->account.trainee[0] &&
           (command->kind == arthron_Command_Kind_STOP ||
            command->kind == arthron_Command_Kind_BEGIN ||
            command->kind == arthron_Command_Kind_LEAVE ||
            command->kind == arthron_Command_Kind_HELP ||
            command->kind == arthron_Command_Kind_TAKE);
}

// A path is for those who may use the server's socket: who asks on a page has no files here.
static const char *refusal_of(const struct viewer *viewer, const arthron_Command *command) {
    enum store_role role = viewer->role;
    arthron_Command_Kind kind = command->kind;
    bool looks = kind == arthron_Command_Kind_LIST || kind == arthron_Command_Kind_SHOW;
    if (role == ROLE_INSTRUCTOR && kind == arthron_Command_Kind_COPY && !trace_is_id(command->from))
        return "a session is copied by its id";
    if (role == ROLE_INSTRUCTOR || (role == ROLE_TECHNICIAN && looks) || practises(viewer, command))
        return NULL;
    return looks ? "that is for instructors and technicians" : "that is for instructors";
}

// False: too busy.
static bool ask_here(struct live_server *live, struct viewer *viewer,
                     const arthron_Command *command) {
    const char *refusal = refusal_of(viewer, command);
    bool here = refusal || !elsewhere_answers(live, viewer, command);
    if (here && !command_runner_add(live, viewer, command, refusal))
        return false;
    return elsewhere_ask(live, viewer, here, refusal ? NULL : command);
}

// Replies come in order: once one command is refused for want of room, those behind it are too,
// until that was told.
static void take_command(struct live_server *live, struct viewer *viewer,
                         const arthron_Command *command) {
    if (viewer->answers_due.count == ASKED_MAX || viewer->refused ||
        !ask_here(live, viewer, command))
        viewer->refused++;
}

static void take_mesh_word(struct live_server *live, struct viewer *viewer,
                           const arthron_Page *message) {
    if (elsewhere_is_followed(viewer))
        elsewhere_say(viewer, message);
    else
        follow_meshes(live, viewer, message);
}

void live_server_take(struct live_server *live, struct viewer *viewer,
                      const arthron_Page *message) {
    switch (message->which_message) {
    case arthron_Page_watch_tag:
        take_watch(live, viewer, &message->message.watch);
        break;
    case arthron_Page_command_tag:
        take_command(live, viewer, &message->message.command);
        break;
    case arthron_Page_mesh_ask_tag:
    case arthron_Page_mesh_ack_tag:
        take_mesh_word(live, viewer, message);
        break;
    default:
        break;
    }
}

// ---- what it is told ----------------------------------------------------------------------------

static void tell_trouble(struct live_server *live, struct viewer *viewer,
                         struct live_batch *batch) {
    if (!viewer->trouble[0])
        return;
    live->item = (arthron_Live){.which_message = arthron_Live_trouble_tag};
    memcpy(live->item.message.trouble.text, viewer->trouble, sizeof viewer->trouble);
    live->item.message.trouble.kind = viewer->trouble_kind;
    live->item.message.trouble.has_why = true;
    live->item.message.trouble.why = viewer->trouble_why;
    bool told = batch_say(batch, &live->item);
    if (told && viewer->trouble_kind == arthron_Trouble_Kind_FAILED) { // of a record
        live->item = (arthron_Live){.which_message = arthron_Live_progress_tag};
        live->item.message.progress.done = true;
        told = batch_say(batch, &live->item);
    }
    if (told)
        viewer->trouble[0] = '\0';
}

static void take_answers(struct viewer *viewer) {
    struct parcel *parcel;
    while (ring_pop(viewer->answers, &parcel)) {
        if (parcel->viewer_number == viewer->number)
            answers_take(&viewer->answers_due, ANSWER_HERE, parcel);
        else
            free(parcel);
    }
}

// Each that is left fits a batch that is empty.
static void tell_answers(struct viewer *viewer, struct live_batch *batch) {
    while (!batch->full && answers_are_next(&viewer->answers_due)) {
        if (batch->used > batch->size / 8) { // it may be a long one
            batch->full = true;
            return;
        }
        struct parcel *parcel = answers_next(&viewer->answers_due);
        if (!batch_put(batch, parcel->bytes, parcel->size))
            viewer_trouble(viewer, arthron_Trouble_Kind_NOTE, arthron_Why_Code_TOO_LONG, NULL,
                           "the answer was too long");
        free(parcel);
    }
}

// Behind the replies to all that were taken.
static void tell_refusals(struct live_server *live, struct viewer *viewer,
                          struct live_batch *batch) {
    live->item = (arthron_Live){.which_message = arthron_Live_command_reply_tag};
    snprintf(live->item.message.command_reply.text, sizeof live->item.message.command_reply.text,
             "%d commands of this page are waiting: send this one again later", ASKED_MAX);
    while (!viewer->answers_due.count && viewer->refused && batch_say(batch, &live->item))
        viewer->refused--;
}

// An empty batch each IDLE_NS shows a page on which nothing changes that the server is there.
static void tell_beat(struct live_server *live, struct viewer *viewer, int64_t now_ns,
                      struct live_batch *batch) {
    if (!batch->used && now_ns - viewer->told_ns >= IDLE_NS) {
        live->item = (arthron_Live){.which_message = arthron_Live_beat_tag};
        batch_say(batch, &live->item);
    }
    if (batch->used)
        viewer->told_ns = now_ns;
}

static int64_t tell_view(struct live_server *live, struct viewer *viewer, int64_t now_ns,
                         struct live_batch *batch) {
    switch (viewer->watch.what) {
    case arthron_Watch_What_WALL:
        return follow_wall(live, viewer, now_ns, batch);
    case arthron_Watch_What_STATION:
        return elsewhere_is_followed(viewer) ? INT64_MAX
                                             : follow_station(live, viewer, now_ns, batch);
    case arthron_Watch_What_RECORDED:
        playback_batch(viewer->playback, batch);
        return now_ns + IDLE_NS;
    default:
        return now_ns + IDLE_NS;
    }
}

static int64_t tell_own(struct live_server *live, struct viewer *viewer, int64_t now_ns,
                        struct live_batch *batch) {
    int64_t next_ns = INT64_MAX;
    tell_answers(viewer, batch);
    tell_refusals(live, viewer, batch);
    tell_trouble(live, viewer, batch);
    if (!batch->full)
        next_ns = tell_view(live, viewer, now_ns, batch);
    tell_trouble(live, viewer, batch); // that the view has come upon
    return next_ns;
}

static int64_t sooner(int64_t a_ns, int64_t b_ns) {
    return a_ns < b_ns ? a_ns : b_ns;
}

size_t live_server_batch(struct live_server *live, struct viewer *viewer, int64_t now_ns,
                         uint8_t *out, size_t size, int64_t *out_next_ns) {
    CHECK(size >= LIVE_BATCH_MAX);
    struct live_batch batch = {out, size, 0, false};
    blindness_renew(&live->blindness, live->commands, now_ns);
    take_answers(viewer);
    *out_next_ns = sooner(elsewhere_turn(live, viewer, now_ns), now_ns + IDLE_NS);
    if (viewer->elsewhere.first)
        elsewhere_put(viewer, &batch);
    bool by_others = batch.used;
    if (!by_others) {
        *out_next_ns = sooner(*out_next_ns, tell_own(live, viewer, now_ns, &batch));
        elsewhere_put(viewer, &batch);
    }
    tell_beat(live, viewer, now_ns, &batch);
    if (batch.full || by_others || viewer->trouble[0])
        *out_next_ns = now_ns;
    return batch.used;
}

// ---- begin and end ------------------------------------------------------------------------------

#define COMMAND_THREADS 4
#define PLAYBACK_NICE 11 // behind workers, cuts and commands; a person waits for it

struct live_server *live_server_create(struct sessions *sessions,
                                       const struct live_config *config) {
    struct live_server *live = alloc(1, sizeof *live);
    struct task_pool_settings commands = {.threads = COMMAND_THREADS,
                                          .tasks_max = LIVE_VIEWERS_MAX * 2 * ASKED_MAX};
    struct task_pool_settings playbacks = {
        .threads = PLAYBACK_THREADS, .tasks_max = 2 * PLAYBACK_THREADS, .nice = PLAYBACK_NICE};
    live->sessions = sessions;
    live->config = *config;
    blindness_init(&live->blindness, live->config.each_blind, live->config.user);
    pthread_rwlock_init(&live->news_lock, NULL);
    live->cache = alloc(station_count(live), sizeof *live->cache);
    live->servers.served_by = alloc(station_count(live), sizeof *live->servers.served_by);
    sessions_whose(sessions, live->servers.others, SERVERS_MAX, live->servers.served_by);
    for (int i = 0; i < LIVE_VIEWERS_MAX; i++) {
        live->viewers[i].answers = ring_create(2 * ASKED_MAX, sizeof(struct parcel *));
        live->viewers[i].sent = alloc(station_count(live), sizeof *live->viewers[i].sent);
    }
    turns_init(&live->turns);
    live->commands = task_pool_create(&commands);
    live->playbacks = task_pool_create(&playbacks);
    return live;
}

// All viewers have left, so what is played ends by itself.
void live_server_destroy(struct live_server **owned) {
    struct live_server *live = *owned;
    *owned = NULL;
    if (!live)
        return;
    live_server_on_news(live, NULL, NULL, NULL);
    for (int i = 0; i < LIVE_VIEWERS_MAX; i++)
        if (live->viewers[i].used)
            live_server_leave(live, &live->viewers[i]);
    task_pool_destroy(&live->commands);
    task_pool_destroy(&live->playbacks);
    blindness_fini(&live->blindness);
    turns_fini(&live->turns);
    for (int i = 0; i < LIVE_VIEWERS_MAX; i++) {
        drop_answers(&live->viewers[i]);
        ring_destroy(&live->viewers[i].answers);
        free(live->viewers[i].sent);
    }
    for (size_t i = 0; i < station_count(live); i++)
        free(live->cache[i].metrics);
    free(live->cache);
    free(live->servers.served_by);
    pthread_rwlock_destroy(&live->news_lock);
    free(live);
}

void live_server_on_news(struct live_server *live, void (*on_news)(void *user),
                         void (*on_news_of)(void *user, struct viewer *viewer), void *user) {
    pthread_rwlock_wrlock(&live->news_lock);
    live->on_news = on_news;
    live->on_news_of = on_news_of;
    live->news_user = user;
    pthread_rwlock_unlock(&live->news_lock);
}

void live_news(void *user) {
    struct live_server *live = user;
    pthread_rwlock_rdlock(&live->news_lock);
    if (live->on_news)
        live->on_news(live->news_user);
    pthread_rwlock_unlock(&live->news_lock);
}

void live_news_of(struct live_server *live, struct viewer *viewer) {
    pthread_rwlock_rdlock(&live->news_lock);
    if (live->on_news_of)
        live->on_news_of(live->news_user, viewer);
    pthread_rwlock_unlock(&live->news_lock);
}
