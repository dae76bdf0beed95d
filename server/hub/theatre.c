// Where the tissue is cut: a thread beside each worker runs the jobs of its sessions, one after the
// other, and then brings the changed meshes to the stations.
#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "hub/reply.h"
#include "hub/seat.h"
#include "hub/tissue_delta.h"

#include <errno.h>
#include <poll.h>
#include <sched.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

#define ROUND_MS 200
#define RING_ORDERS 1024

enum order_kind { ORDER_OPEN, ORDER_RUN, ORDER_LANDED, ORDER_CLOSE };

// From the worker. A session has one job on its way at most, so the ring never overflows.
struct order {
    enum order_kind kind;
    int seat;
    struct live *live; // ORDER_OPEN, ORDER_CLOSE
    uint64_t serial;   // of the session
    bool deserted;
    struct job job;
    struct job_result *result;
};

// From the control thread.
struct word {
    int seat;
    struct control_peer peer;
    bool gone;
    arthron_Control message; // MeshAsk or mesh_ack
};

struct done {
    int seat;
    uint64_t serial;
    struct job_result *result;
};

// The theatre's own view of a seat.
struct table {
    struct live *live;
    struct control_peer peer;
    struct mesh_feed *feeds[TISSUES_MAX];
    struct mesh_cursor cursors[TISSUES_MAX];
    struct onlookers onlookers;
};

struct theatre {
    struct hub *hub;
    struct worker *worker;
    pthread_t thread;
    atomic_bool stop;
    int wake_fd;
    struct ring *orders;  // of struct order
    struct ring *words;   // of struct word
    struct ring *looks;   // of struct look
    struct ring *done;    // of struct done, to the worker
    struct ring *retired; // of struct retired, to the desk
    struct table tables[HUB_STATIONS_MAX];
};

static void wake(int fd) {
    uint64_t one = 1;
    ssize_t written = write(fd, &one, sizeof one);
    CHECK(written == sizeof one || errno == EAGAIN);
}

// ---- meshes to stations -------------------------------------------------------------------------

static const char *group_name(const struct live *live, int tissue) {
    int group = scene_tissue_group(live->scene, tissue);
    return scene_case(live->scene)->groups[group].name;
}

static void send_meshes(struct theatre *theatre, struct table *table) {
    for (int i = 0; i < TISSUES_MAX && table->live; i++) {
        struct mesh_payload *payload = NULL;
        if (table->feeds[i])
            payload = mesh_feed_next(table->feeds[i], &table->cursors[i]);
        if (payload)
            control_send_mesh(theatre->hub->control, table->peer, payload);
        mesh_payload_release(&payload);
    }
    if (table->live)
        onlookers_serve(&table->onlookers, table->live->serial, table->feeds);
}

static uint64_t mesh_hash(const struct table *table, int tissue) {
    const struct mesh_feed *feed = table->feeds[tissue];
    return feed ? mesh_feed_tissue(feed)->hash : 0;
}

static void send_figures(struct theatre *theatre, const struct table *table, int tissue) {
    arthron_Control message = {.which_message = arthron_Control_resection_tag};
    if (!table->cursors[tissue].asked)
        return;
    reply_resection(operation_figures(table->live->operation, tissue),
                    group_name(table->live, tissue), mesh_hash(table, tissue),
                    &message.message.resection);
    control_send(theatre->hub->control, table->peer, &message);
}

// For whoever lists the sessions; not where the desk has changed the case since.
static void publish_figures(struct theatre *theatre, int seat) {
    const struct table *table = &theatre->tables[seat];
    struct card *card = &theatre->hub->seats[seat].card;
    pthread_mutex_lock(&theatre->hub->card_lock);
    bool is_of_card = theatre->hub->scenes[card->scene] == table->live->scene;
    if (is_of_card)
        card->figures_of = table->live->serial;
    for (int i = 0; is_of_card && i < scene_tissue_count(table->live->scene); i++) {
        card->tissues[i] = *operation_figures(table->live->operation, i);
        card->mesh_hashes[i] = mesh_hash(table, i);
    }
    pthread_mutex_unlock(&theatre->hub->card_lock);
}

static void drop_feed(struct table *table, int tissue, const struct error *err) {
    log_error("hub", "%s: its mesh cannot be sent: %s", group_name(table->live, tissue), err->text);
    mesh_feed_destroy(&table->feeds[tissue]);
}

static void open_feeds(struct table *table) {
    const struct live *live = table->live;
    for (int i = 0; i < scene_tissue_count(live->scene); i++) {
        struct mesh_delta whole;
        struct error err;
        tissue_delta_whole(operation_mesh(live->operation, i), &whole);
        whole.number = operation_figures(live->operation, i)->mesh_number;
        if (mesh_feed_create(group_name(live, i), &whole, &table->feeds[i], &err) != RESULT_OK)
            drop_feed(table, i, &err);
        mesh_delta_fini(&whole);
    }
}

static void push_change(struct table *table, const struct job_result *result) {
    struct mesh_feed *feed = table->feeds[result->tissue];
    const struct cut_mesh *mesh = operation_mesh(table->live->operation, result->tissue);
    if (!feed || mesh_feed_tissue(feed)->number == result->figures.mesh_number)
        return;
    CHECK(operation_figures(table->live->operation, result->tissue)->mesh_number ==
          result->figures.mesh_number);
    struct mesh_delta delta;
    struct error err;
    if (result->change.made_count)
        tissue_delta_of_change(mesh, &result->change, &delta);
    else
        tissue_delta_between(mesh_feed_tissue(feed), mesh, &delta);
    if (mesh_feed_push(feed, &delta, &err) != RESULT_OK)
        drop_feed(table, result->tissue, &err);
    mesh_delta_fini(&delta);
}

// ---- orders of the worker -----------------------------------------------------------------------

static void open_table(struct theatre *theatre, const struct order *order) {
    struct table *table = &theatre->tables[order->seat];
    table->live = order->live;
    open_feeds(table);
    publish_figures(theatre, order->seat);
}

static void run(struct theatre *theatre, const struct order *order) {
    struct table *table = &theatre->tables[order->seat];
    CHECK(table->live && table->live->serial == order->serial);
    struct job_result *result = operation_run(table->live->operation, &order->job);
    uint32_t refused = result->figures.refused;
    if (result->outcome == JOB_REFUSED && (refused & (refused - 1)) == 0) // a burr asks on and on
        log_warning("hub", "station %s: a cut was refused: %s",
                    theatre->hub->seats[order->seat].station->name, result->why.text);
    struct done done = {order->seat, order->serial, result};
    bool pushed = ring_push(theatre->done, &done);
    CHECK(pushed);
    wake(theatre->worker->wake_fd);
}

static void publish(struct theatre *theatre, const struct order *order) {
    struct table *table = &theatre->tables[order->seat];
    if (order->result->outcome == JOB_NOTHING)
        return;
    push_change(table, order->result);
    publish_figures(theatre, order->seat);
    send_meshes(theatre, table);
    send_figures(theatre, table, order->result->tissue);
}

// The last job of an undo tells how it came out; not where a later session was asked since.
static void publish_undo(struct hub *hub, const struct order *order) {
    const struct job_result *result = order->result;
    struct seat *seat = &hub->seats[order->seat];
    struct card *card = &seat->card;
    pthread_mutex_lock(&hub->card_lock);
    if (card->undo_of == order->serial) {
        card->undone.cuts += result->cuts_back;
        card->undone.volume_mm3 += result->mm3_back;
        if (!result->more)
            atomic_store(&seat->counts.undo, (int)result->outcome);
    }
    pthread_mutex_unlock(&hub->card_lock);
}

static void close_table(struct theatre *theatre, const struct order *order) {
    struct table *table = &theatre->tables[order->seat];
    for (int i = 0; i < TISSUES_MAX; i++)
        mesh_feed_destroy(&table->feeds[i]);
    memset(table->cursors, 0, sizeof table->cursors);
    onlookers_forget(&table->onlookers);
    table->live = NULL;
    struct retired retired = {order->seat, order->deserted, order->live};
    bool pushed = ring_push(theatre->retired, &retired);
    CHECK(pushed);
}

static void take_order(struct theatre *theatre, struct order *order) {
    struct table *table = &theatre->tables[order->seat];
    switch (order->kind) {
    case ORDER_OPEN:
        open_table(theatre, order);
        break;
    case ORDER_RUN:
        run(theatre, order);
        break;
    case ORDER_LANDED:
        if (table->live && table->live->serial == order->serial)
            publish(theatre, order);
        if (order->result->kind == JOB_UNDO)
            publish_undo(theatre->hub, order);
        job_result_destroy(&order->result);
        break;
    case ORDER_CLOSE:
        close_table(theatre, order);
        break;
    }
}

// ---- words of the station -----------------------------------------------------------------------

static void take_ack(struct table *table, const arthron_MeshState *ack) {
    for (int i = 0; i < scene_tissue_count(table->live->scene); i++)
        if (!strcmp(group_name(table->live, i), ack->group))
            mesh_cursor_ack(&table->cursors[i], ack);
}

static void take_ask(struct theatre *theatre, struct table *table, const arthron_MeshAsk *ask) {
    for (int i = 0; i < scene_tissue_count(table->live->scene); i++) {
        mesh_cursor_ask(&table->cursors[i], group_name(table->live, i), ask);
        send_figures(theatre, table, i);
    }
}

static void take_word(struct theatre *theatre, const struct word *word) {
    struct table *table = &theatre->tables[word->seat];
    if (word->gone) {
        memset(table->cursors, 0, sizeof table->cursors);
        return;
    }
    table->peer = word->peer;
    if (!table->live)
        return;
    if (word->message.which_message == arthron_Control_mesh_ask_tag)
        take_ask(theatre, table, &word->message.message.mesh_ask);
    else
        take_ack(table, &word->message.message.mesh_ack);
    send_meshes(theatre, table);
}

// ---- what pages say that look on ----------------------------------------------------------------

static void take_look(struct theatre *theatre, struct look *look) {
    struct table *table = &theatre->tables[look->seat];
    if (table->live && table->live->serial == look->session) {
        const char *groups[TISSUES_MAX];
        int count = scene_tissue_count(table->live->scene);
        for (int i = 0; i < count; i++)
            groups[i] = group_name(table->live, i);
        onlookers_hear(&table->onlookers, look, groups, count);
        send_meshes(theatre, table);
    }
    tray_release(&look->tray);
}

// ---- the thread ---------------------------------------------------------------------------------

// What there is now, and the rest in the next round, so that words do not wait for an end of the
// orders, which may never come. A station asks for meshes when it hears of its session, of which
// the order was given before: words are counted first and taken last. So does a page.
static void take_round(struct theatre *theatre) {
    size_t words = ring_count(theatre->words), looks = ring_count(theatre->looks);
    size_t orders = ring_count(theatre->orders);
    struct order order;
    struct word word;
    struct look look;
    for (; orders && ring_pop(theatre->orders, &order); orders--)
        take_order(theatre, &order);
    for (; words && ring_pop(theatre->words, &word); words--)
        take_word(theatre, &word);
    for (; looks && ring_pop(theatre->looks, &look); looks--)
        take_look(theatre, &look);
}

static void *operate(void *argument) {
    struct theatre *theatre = argument;
    struct sched_param none = {0};
    sched_setscheduler(0, SCHED_IDLE, &none); // the worker goes first, whenever it wakes
    struct pollfd fd = {.fd = theatre->wake_fd, .events = POLLIN};
    bool stop = false;
    while (!stop) {
        poll(&fd, 1, ROUND_MS);
        uint64_t wakes;
        if (fd.revents && read(theatre->wake_fd, &wakes, sizeof wakes) < 0)
            CHECK(errno == EAGAIN);
        stop = atomic_load(&theatre->stop);
        take_round(theatre);
    }
    return NULL;
}

void theatre_start(struct worker *worker) {
    struct theatre *theatre = alloc(1, sizeof *theatre);
    worker->theatre = theatre;
    theatre->hub = worker->hub;
    theatre->worker = worker;
    theatre->wake_fd = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    CHECK(theatre->wake_fd >= 0);
    theatre->orders = ring_create(RING_ORDERS, sizeof(struct order));
    theatre->words = ring_create(RING_ORDERS, sizeof(struct word));
    theatre->looks = ring_create(RING_ORDERS, sizeof(struct look));
    theatre->done = ring_create(RING_ORDERS, sizeof(struct done));
    theatre->retired = ring_create(RING_ORDERS, sizeof(struct retired));
    int failed = pthread_create(&theatre->thread, NULL, operate, theatre);
    CHECK(!failed);
}

void theatre_stop(struct worker *worker) {
    struct theatre *theatre = worker->theatre;
    if (!theatre)
        return;
    atomic_store(&theatre->stop, true);
    wake(theatre->wake_fd);
    pthread_join(theatre->thread, NULL);
}

void theatre_release(struct worker *worker) {
    struct theatre *theatre = worker->theatre;
    struct done done;
    struct look look;
    if (!theatre)
        return;
    while (ring_pop(theatre->done, &done))
        job_result_destroy(&done.result);
    while (ring_pop(theatre->looks, &look))
        tray_release(&look.tray);
    for (int i = 0; i < HUB_STATIONS_MAX; i++)
        onlookers_fini(&theatre->tables[i].onlookers);
    ring_destroy(&theatre->orders);
    ring_destroy(&theatre->words);
    ring_destroy(&theatre->looks);
    ring_destroy(&theatre->done);
    ring_destroy(&theatre->retired);
    close(theatre->wake_fd);
    free(theatre);
    worker->theatre = NULL;
}

// ---- what the other threads call ----------------------------------------------------------------

static void give(struct theatre *theatre, const struct order *order) {
    bool pushed = ring_push(theatre->orders, order);
    CHECK(pushed);
    wake(theatre->wake_fd);
}

void theatre_open(struct theatre *theatre, int seat, struct live *live) {
    give(theatre, &(struct order){.kind = ORDER_OPEN, .seat = seat, .live = live});
}

void theatre_run(struct theatre *theatre, int seat, const struct live *live,
                 const struct job *job) {
    give(theatre,
         &(struct order){.kind = ORDER_RUN, .seat = seat, .serial = live->serial, .job = *job});
}

void theatre_landed(struct theatre *theatre, int seat, uint64_t serial, struct job_result *result) {
    give(theatre,
         &(struct order){.kind = ORDER_LANDED, .seat = seat, .serial = serial, .result = result});
}

void theatre_close(struct theatre *theatre, int seat, struct live *live, bool deserted) {
    give(theatre,
         &(struct order){.kind = ORDER_CLOSE, .seat = seat, .live = live, .deserted = deserted});
}

bool theatre_take(struct theatre *theatre, int *out_seat, uint64_t *out_serial,
                  struct job_result **out_result) {
    struct done done;
    if (!ring_pop(theatre->done, &done))
        return false;
    *out_seat = done.seat;
    *out_serial = done.serial;
    *out_result = done.result;
    return true;
}

void theatre_tell(struct theatre *theatre, int seat, struct control_peer peer,
                  const arthron_Control *message) {
    struct word word = {.seat = seat, .peer = peer, .gone = !message};
    if (message)
        word.message = *message;
    if (!ring_push(theatre->words, &word))
        log_warning("hub", "station %s: a word about meshes was lost",
                    theatre->hub->seats[seat].station->name);
    wake(theatre->wake_fd);
}

bool theatre_look(struct theatre *theatre, const struct look *look) {
    if (!ring_push(theatre->looks, look))
        return false;
    wake(theatre->wake_fd);
    return true;
}

bool theatre_retired(struct theatre *theatre, struct retired *out_retired) {
    return ring_pop(theatre->retired, out_retired);
}
