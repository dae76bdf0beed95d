// Viewers, batches and the cache of each station's messages. Private to this room.
#pragma once

#include "base/bucket.h"
#include "base/ring.h"
#include "base/task_pool.h"
#include "live/answers.h"
#include "live/blindness.h"
#include "live/elsewhere.h"
#include "live/live.h"
#include "live/playback_turns.h"
#include "sessions/sessions.h"
#include "store/store.h"
#include "wire/live.h"

#include <pthread.h>
#include <semaphore.h>

// ---- batches ------------------------------------------------------------------------------------

struct live_batch {
    uint8_t *bytes;
    size_t size, used;
    bool full; // an item had no room
};

// False if there is no room; the batch is then full.
bool batch_put(struct live_batch *batch, const void *items, size_t size);
bool batch_say(struct live_batch *batch, const arthron_Live *item);

// A mesh's payload in pieces, as MeshChunk holds them. chunk: memory of the caller for one piece.
uint32_t chunk_count(const struct mesh_payload *payload);
bool chunk_say(const struct mesh_payload *payload, uint32_t index, arthron_MeshChunk *chunk,
               struct live_batch *batch);

// Encoded items on their way from another thread to one viewer.
struct parcel {
    uint32_t viewer_number; // of an answer: the viewer that it is for
    size_t size;
    uint8_t bytes[];
};

// NULL if the item is too long for any batch.
struct parcel *parcel_of(const arthron_Live *item, uint32_t viewer_number);

// ---- the cache of a station's messages ----------------------------------------------------------

#define MOMENT_ITEM_MAX (arthron_Moment_size + 16)
#define PLACE_ITEM_MAX (arthron_Place_size + 16)

// Messages that are the same for all viewers, so made once: the newest moment, the place of the
// last second, the metrics of the last two seconds.
struct station_cache {
    int64_t taken_ns;
    struct step_snapshot moment;
    struct session_about about;
    bool connected;
    enum session_state state;
    uint64_t item_session, item_step; // of the moment that is encoded
    size_t item_size;
    uint8_t item[MOMENT_ITEM_MAX];

    struct live_attempt attempt;

    uint32_t place_number; // counts up with each place made
    int place_state;
    bool place_connected;
    int64_t place_ns;
    uint64_t frames, lost, late, samples[WIRE_DEVICES_MAX]; // when it was made
    size_t place_size, nameless_size;
    uint8_t place[PLACE_ITEM_MAX], nameless[PLACE_ITEM_MAX];
    char trainee[64], next_trainee[64]; // whom the place names

    int64_t metrics_ns;
    uint64_t metrics_of; // serial of the session
    size_t metrics_size;
    uint8_t *metrics;
};

// ---- viewers ------------------------------------------------------------------------------------

struct playback;

struct viewer {
    bool used;
    uint32_t number; // tells this viewer from others that used the slot before
    struct live_account account;
    enum store_role role; // ROLE_COUNT: none
    char trouble[256];    // not sent yet
    arthron_Trouble_Kind trouble_kind;
    arthron_Why trouble_why;
    int64_t told_ns;      // when it last got a batch
    struct ring *answers; // of struct parcel *, from a thread of its commands
    struct answers answers_due;
    int refused; // commands after these, which are refused
    struct elsewhere elsewhere;

    arthron_Watch watch;
    int64_t period_ns, due_ns; // of moments
    int turn;                  // the station at which the next batch of a wall begins
    struct sent_state {
        uint64_t session, step;
        uint32_t place;
        uint64_t attempt_of; // session
        uint32_t attempt;    // of its news, the last that the page has
        bool elsewhere;      // another server has told of it
    } * sent;                // of each station

    // One station:
    int station; // -1: none
    bool introduced, barred;
    uint64_t session;               // the last that the page was told of
    uint64_t remarks;               // revision of the remarks that the page has
    uint64_t remarked[REMARKS_MAX]; // revision of each of these
    uint64_t markers;               // of the session that the page has
    bool resected[TISSUES_MAX];
    struct tissue_figures figures[TISSUES_MAX]; // the last that the page got
    int64_t metrics_ns;
    struct mailbox *mailbox; // NULL: no meshes
    struct mesh_words words; // of the page, which the cut worker has not got yet
    struct bucket asks, acks;
    struct sending {
        struct mesh_payload *payload;
        uint32_t index;
    } sendings[TISSUES_MAX];

    struct playback *playback;
};

struct live_server {
    struct sessions *sessions;
    struct live_config config;
    struct viewer viewers[LIVE_VIEWERS_MAX];
    uint32_t numbers;
    struct station_cache *cache; // of each station
    struct blindness blindness;
    struct live_servers servers;
    arthron_Live item; // too large for a stack, as is the chunk
    arthron_MeshChunk chunk;
    struct task_pool *commands;  // commands of one page run in order
    struct task_pool *playbacks; // of recorded sessions
    struct playback_turns turns; // of those
    atomic_int playbacks_called; // threads that are to look for a turn
    pthread_rwlock_t news_lock;  // of on_news and news_user
    void (*on_news)(void *user);
    void (*on_news_of)(void *user, struct viewer *viewer);
    void *news_user;
};

static inline bool is_staff(const struct viewer *viewer) {
    return viewer->role == ROLE_INSTRUCTOR || viewer->role == ROLE_TECHNICIAN;
}

// `parameter` of the code, or NULL.
void viewer_trouble(struct viewer *viewer, arthron_Trouble_Kind kind, arthron_Why_Code code,
                    const char *parameter, const char *format, ...)
    __attribute__((format(printf, 5, 6)));

// ---- snapshot_cache.c: for the web server's thread ----

// Makes the moment of a station again if it is older than age_ns.
void cache_refresh(struct live_server *live, int station, int64_t now_ns, int64_t age_ns);
// Makes the place of a station again each second, and when the station's state changes.
void cache_place(struct live_server *live, int station, int64_t now_ns);
void cache_metrics(struct live_server *live, int station, int64_t now_ns);

// ---- follow.c: for the web server's thread ----

// Fill a batch, and return the time at which there may be more.
int64_t follow_wall(struct live_server *live, struct viewer *viewer, int64_t now_ns,
                    struct live_batch *batch);
int64_t follow_station(struct live_server *live, struct viewer *viewer, int64_t now_ns,
                       struct live_batch *batch);
void follow_end(struct viewer *viewer); // the viewer no longer watches this
// The same station is told from the beginning, here or at another server.
void follow_anew(struct viewer *viewer);
// Says that the viewer may not see what is at a station, if there is one.
void follow_bar(struct viewer *viewer, const char *station);
// Takes a page's message about its meshes. It reaches the cut worker when the page may be served.
void follow_meshes(struct live_server *live, struct viewer *viewer, const arthron_Page *message);

// ---- command_runner.c ----

// False: too busy. refusal: why the command is refused, or NULL.
bool command_runner_add(struct live_server *live, const struct viewer *viewer,
                        const arthron_Command *command, const char *refusal);

// ---- live.c ----

// Calls on_news: some viewer may have a batch. From any thread, never waits. user: the live_server.
void live_news(void *user);
// This viewer may have one. The web server's thread.
void live_news_of(struct live_server *live, struct viewer *viewer);
