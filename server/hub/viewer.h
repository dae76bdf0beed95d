// The inside of the audience, for its own files: viewers, what is shown of a seat, batches.
#pragma once

#include "hub/audience.h"
#include "hub/seat.h"
#include "wire/live.h"

#include <semaphore.h>

#define ASKED_MAX 8 // commands of one page that are not answered yet

// ---- batches ------------------------------------------------------------------------------------

struct batch {
    uint8_t *bytes;
    size_t size, used;
    bool full; // something did not find room
};

// False, and full, where it finds no room.
bool batch_put(struct batch *batch, const void *items, size_t size);
bool batch_say(struct batch *batch, const arthron_Live *item);

// A mesh's payload in pieces, as MeshChunk has them. chunk: the caller's room for one.
uint32_t chunk_count(const struct mesh_payload *payload);
bool chunk_say(const struct mesh_payload *payload, uint32_t index, arthron_MeshChunk *chunk,
               struct batch *batch);

// Encoded items on their way from another thread to one viewer.
struct parcel {
    uint32_t guest; // struct viewer's number, of an answer
    size_t size;
    uint8_t bytes[];
};

// NULL where the item is too long for any batch.
struct parcel *parcel_of(const arthron_Live *item, uint32_t guest);

// ---- what is shown of a seat --------------------------------------------------------------------

#define MOMENT_ITEM_MAX (arthron_Moment_size + 16)
#define PLACE_ITEM_MAX (arthron_Place_size + 16)

// The same for all viewers, so made once: the newest moment, the place of the last second, the
// metrics of the last two.
struct shown {
    int64_t taken_ns;
    struct moment moment;
    struct about about;
    bool connected;
    uint64_t item_session, item_step; // of the moment that is encoded
    size_t item_size;
    uint8_t item[MOMENT_ITEM_MAX];

    uint32_t place_number; // counts up with each place made
    int place_state;
    bool place_connected;
    int64_t place_ns;
    uint64_t frames, lost, samples[WIRE_DEVICES_MAX]; // when it was made
    size_t place_size;
    uint8_t place[PLACE_ITEM_MAX];

    int64_t metrics_ns;
    uint64_t metrics_of; // struct live's serial
    size_t metrics_size;
    uint8_t *metrics;
};

// ---- viewers ------------------------------------------------------------------------------------

struct playback;

struct viewer {
    bool used;
    uint32_t number; // tells one user of the place from the next
    struct guest guest;
    enum store_role role; // ROLE_COUNT: none
    char trouble[256];    // still to be told
    arthron_Trouble_Kind trouble_kind;
    int64_t told_ns;      // when it last got something
    struct ring *answers; // of struct parcel *, from its runner
    int asked;            // commands that are not answered yet
    int refused;          // and those behind them, which are refused

    arthron_Watch watch;
    int64_t period_ns, due_ns; // of moments
    int turn;                  // the seat at which the next batch of a wall begins
    struct sent {
        uint64_t session, step;
        uint32_t place;
    } sent[HUB_STATIONS_MAX];

    // One station:
    int seat; // -1: none
    bool introduced, barred;
    uint64_t session; // that the page was told of
    uint64_t remarks; // revision of those that the page has, and of each of them
    uint64_t remarked[REMARKS_MAX];
    bool resected[TISSUES_MAX];
    struct tissue_figures figures[TISSUES_MAX]; // that the page has
    int64_t metrics_ns;
    struct tray *tray; // NULL: no meshes
    struct sending {
        struct mesh_payload *payload;
        uint32_t index;
    } sendings[TISSUES_MAX];

    struct playback *playback;
};

struct audience {
    struct hub *hub;
    struct audience_config config;
    struct viewer viewers[AUDIENCE_VIEWERS_MAX];
    uint32_t numbers;
    struct shown shown[HUB_STATIONS_MAX];
    arthron_Live item; // both too large for a stack
    arthron_MeshChunk chunk;
    struct usher *usher;
};

static inline bool is_staff(const struct viewer *viewer) {
    return viewer->role == ROLE_INSTRUCTOR || viewer->role == ROLE_TECHNICIAN;
}

void viewer_trouble(struct viewer *viewer, arthron_Trouble_Kind kind, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

// ---- shown.c: all of the thread of the pages
// ------------------------------------------------------

// Brings the moment of a seat up to date where it is older than that.
void shown_refresh(struct audience *audience, int seat, int64_t now_ns, int64_t age_ns);
// The place of each seat is made anew each second, and when its state changes.
void shown_place(struct audience *audience, int seat, int64_t now_ns);
void shown_metrics(struct audience *audience, int seat, int64_t now_ns);

// ---- follow.c
// -------------------------------------------------------------------------------------

// Fill a batch; return when there may be more.
int64_t follow_wall(struct audience *audience, struct viewer *viewer, int64_t now_ns,
                    struct batch *batch);
int64_t follow_station(struct audience *audience, struct viewer *viewer, int64_t now_ns,
                       struct batch *batch);
void follow_end(struct viewer *viewer); // the page looks elsewhere
// What the page says of its meshes; false: too busy.
bool follow_meshes(struct audience *audience, struct viewer *viewer, const arthron_Page *message);

// ---- usher.c: the threads that do what pages ask for and may take time
// ----------------------

struct usher *usher_start(struct audience *audience);
void usher_stop(struct usher **usher);
// False: too busy. refusal: why the command is not done, or NULL.
bool usher_command(struct usher *usher, const struct viewer *viewer, const arthron_Command *command,
                   const char *refusal);
// Takes a reference of its own. False: too busy.
bool usher_play(struct usher *usher, struct playback *playback);
