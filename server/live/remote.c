#include "live/remote.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "runtime/reply.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define SILENT_NS (5 * NS_PER_S)   // a server tells something each second
#define LINGER_NS (10 * NS_PER_S)  // an unneeded connection stays so long
#define COMPLAIN_NS (2 * NS_PER_S) // so long it may be away until the page is told
#define RETRY_NS (500 * NS_PER_MS) // doubled with each failure
#define RETRY_DOUBLINGS 4
#define LOG_NS (10 * NS_PER_S)

// ---- losing it ----------------------------------------------------------------------------------

int remote_number(const struct remote *remote) {
    return 1 + (int)(remote - remote->viewer->elsewhere.remotes);
}

static void drop_waiting(struct remote *remote) {
    for (int i = 0; i < remote->waiting_count; i++)
        free(remote->waiting[i]);
    remote->waiting_count = 0;
    remote->at = 0;
}

void remote_refuse(struct remote *remote) {
    struct live_server *live = remote->live;
    live->item = (arthron_Live){.which_message = arthron_Live_command_reply_tag};
    reply_refuse_as(&live->item.message.command_reply, arthron_Why_Code_SERVER_AWAY, remote->name,
                    "server %s did not answer: whether the command was done is unknown",
                    remote->name);
    struct parcel *refusal = parcel_of(&live->item, 0);
    CHECK(refusal);
    answers_lost(&remote->viewer->answers_due, remote_number(remote), refusal);
    free(refusal);
}

// Something is to be done at once.
static void hurry(struct remote *remote) {
    remote->viewer->elsewhere.due_ns = 0;
    live_news_of(remote->live, remote->viewer);
}

// Many pages lose it at the same time.
static void tell_log(const struct remote *remote, const char *why, int64_t now_ns) {
    struct live_servers *servers = &remote->live->servers;
    if (servers->logged_ns && now_ns - servers->logged_ns < LOG_NS)
        return;
    log_warning("live", "pages do not see what server %s (%s) serves: %s", remote->name,
                remote->pages, why);
    servers->logged_ns = now_ns;
}

static void lose(struct remote *remote, const char *why) {
    int64_t now_ns = clock_now_ns();
    if (!remote->lost_ns) {
        remote->lost_ns = now_ns;
        tell_log(remote, why, now_ns);
    }
    int doublings = remote->failures < RETRY_DOUBLINGS ? remote->failures : RETRY_DOUBLINGS;
    remote->failures++;
    remote->retry_ns = now_ns + ((int64_t)RETRY_NS << doublings);
    remote->is_in = false;
    drop_waiting(remote);
    remote_refuse(remote);
    hurry(remote);
}

static void break_off(struct remote *remote, const char *why) {
    relay_close(&remote->relay);
    lose(remote, why);
}

static void on_ended(void *user, const char *why) {
    struct remote *remote = user;
    remote->relay = NULL;
    lose(remote, why);
}

void remote_say(struct remote *remote, const arthron_Page *message) {
    if (remote->relay && !relay_say(remote->relay, message))
        break_off(remote, "it takes no messages");
}

static void say_drawn(struct remote *remote) {
    remote->passed++;
    remote->heard_ns = clock_now_ns();
    remote_say(remote, &(arthron_Page){.which_message = arthron_Page_drawn_tag,
                                       .message.drawn.batches = remote->passed});
}

// What came for what the page watched before.
static void skip_waiting(struct remote *remote) {
    int count = remote->waiting_count;
    drop_waiting(remote);
    for (int i = 0; i < count; i++)
        say_drawn(remote);
}

// ---- what it tells ------------------------------------------------------------------------------

static int on_find(void *user, const char *station, int likely) {
    const struct remote *remote = user;
    const struct sessions_config *config = sessions_config(remote->live->sessions);
    if (likely >= 0 && !strcmp(config->stations[likely].name, station))
        return likely;
    return sessions_find_station(config, station);
}

static bool wanted_on_wall(struct remote *remote, uint32_t kind, int station) {
    struct viewer *viewer = remote->viewer;
    if (station < 0 || remote->live->servers.served_by[station] != remote->index)
        return false;
    if (kind == arthron_Live_place_tag)
        viewer->sent[station].elsewhere = true;
    return true;
}

static bool on_wanted(void *user, uint32_t kind, int station) {
    struct remote *remote = user;
    const struct viewer *viewer = remote->viewer;
    bool is_numbered = kind == arthron_Live_place_tag || kind == arthron_Live_session_tag ||
                       kind == arthron_Live_moment_tag || kind == arthron_Live_attempt_tag;
    if (!remote->needed || remote->told != viewer->elsewhere.watch || kind == arthron_Live_beat_tag)
        return false;
    switch (viewer->watch.what) {
    case arthron_Watch_What_WALL:
        return wanted_on_wall(remote, kind, station);
    case arthron_Watch_What_STATION:
        return !is_numbered || station == viewer->station;
    default:
        return true;
    }
}

static void on_reply(void *user, const uint8_t *item, size_t size) {
    struct remote *remote = user;
    struct parcel *parcel = alloc(1, sizeof *parcel + size);
    parcel->size = size;
    memcpy(parcel->bytes, item, size);
    answers_take(&remote->viewer->answers_due, remote_number(remote), parcel);
}

// It has not the record that the page watches.
static void pass_over(struct remote *remote) {
    remote->viewer->elsewhere.followed = -1;
    remote->needed = false;
    hurry(remote);
}

// Nothing is kept of what is nothing to the page.
static void keep(struct remote *remote, struct parcel *parcel) {
    if (parcel->size) {
        remote->waiting[remote->waiting_count++] = parcel;
        return;
    }
    free(parcel);
    say_drawn(remote);
}

static void on_heard(void *user, const uint8_t *batch, size_t size) {
    struct remote *remote = user;
    struct passing passing = {&remote->numbers, remote, on_find, on_wanted, on_reply, 0};
    struct parcel *parcel = alloc(1, sizeof *parcel + PASSING_GROWTH * size);
    remote->heard_ns = clock_now_ns();
    if (!remote->is_in)
        hurry(remote);
    remote->is_in = true;
    remote->lost_ns = 0;
    remote->failures = 0;
    remote->complained = false;
    bool good = passing_take(&passing, batch, size, parcel->bytes, &parcel->size);
    bool is_missing = passing.why == arthron_Why_Code_NOT_HERE &&
                      remote->viewer->watch.what == arthron_Watch_What_RECORDED;
    if (!good || remote->waiting_count == REMOTE_WAITING_MAX) {
        free(parcel);
        break_off(remote, "what it sends is not of /live");
        return;
    }
    if (is_missing && remote->needed) {
        parcel->size = 0;
        pass_over(remote);
    }
    keep(remote, alloc_resize(parcel, 1, sizeof *parcel + parcel->size));
    live_news_of(remote->live, remote->viewer);
}

// ---- connections --------------------------------------------------------------------------------

static void forget_numbers(struct remote *remote) {
    for (int i = 0; i < remote->numbers.count; i++)
        remote->numbers.own[i] = -1;
}

static const arthron_Page own_nothing = {.which_message = arthron_Page_watch_tag,
                                         .message.watch.own = true};

static void open_relay(struct remote *remote) {
    const struct relay_handler handler = {remote, on_heard, on_ended};
    struct live_server *live = remote->live;
    remote->told = 0;
    remote->passed = 0;
    remote->is_in = false;
    forget_numbers(remote);
    remote->relay =
        relay_open(live->config.relays, remote->pages, remote->viewer->elsewhere.token, &handler);
    if (remote->relay) // before any command: so it asks no other server in its turn
        remote_say(remote, &own_nothing);
    else
        lose(remote, "this server has too many connections to others");
}

void remote_free(struct remote *remote) {
    relay_close(&remote->relay);
    drop_waiting(remote);
    free(remote->numbers.own);
    *remote = (struct remote){.live = remote->live, .viewer = remote->viewer};
}

struct remote *remote_of(struct live_server *live, struct viewer *viewer, int index) {
    const struct cluster_peer *other = &live->servers.others[index];
    struct remote *remotes = viewer->elsewhere.remotes, *free_one = NULL;
    for (int i = REMOTES_MAX - 1; i >= 0; i--) {
        if (!remotes[i].name[0])
            free_one = &remotes[i];
        else if (!strcmp(remotes[i].name, other->name))
            return &remotes[i];
    }
    if (!free_one)
        return NULL;
    *free_one = (struct remote){.live = live, .viewer = viewer, .index = index};
    memcpy(free_one->name, other->name, sizeof free_one->name);
    memcpy(free_one->pages, other->pages, sizeof free_one->pages);
    free_one->numbers.count = STATIONS_MAX;
    free_one->numbers.own = alloc(STATIONS_MAX, sizeof *free_one->numbers.own);
    return free_one;
}

static int index_of(const struct live_servers *servers, const char *name) {
    for (int i = 0; i < servers->count; i++)
        if (servers->others[i].lives && !strcmp(servers->others[i].name, name))
            return i;
    return -1;
}

void remote_find(struct remote *remote) {
    const char *pages;
    remote->index = index_of(&remote->live->servers, remote->name);
    pages = remote->index < 0 ? "" : remote->live->servers.others[remote->index].pages;
    if (!pages[0] || !strcmp(remote->pages, pages))
        return;
    snprintf(remote->pages, sizeof remote->pages, "%s", pages);
    if (remote->relay)
        break_off(remote, "it has moved");
    remote->retry_ns = 0;
}

static void tell_watch(struct remote *remote) {
    const struct elsewhere *e = &remote->viewer->elsewhere;
    arthron_Page message = own_nothing;
    uint32_t now = remote->needed ? e->watch : 0;
    if (!remote->is_in || remote->told == now)
        return;
    skip_waiting(remote);
    if (remote->needed)
        message.message.watch = remote->viewer->watch;
    message.message.watch.own = true;
    remote->told = now;
    remote_say(remote, &message);
}

static bool is_silent(const struct remote *remote, int64_t now_ns) {
    return remote->is_in && !remote->waiting_count && now_ns - remote->heard_ns >= SILENT_NS;
}

static void complain(struct remote *remote, int64_t now_ns) {
    if (!remote->needed || remote->complained || !remote->lost_ns ||
        now_ns - remote->lost_ns < COMPLAIN_NS)
        return;
    viewer_trouble(remote->viewer, arthron_Trouble_Kind_NOTE, arthron_Why_Code_SERVER_AWAY,
                   remote->name, "server %s does not answer: what it serves is not shown",
                   remote->name);
    remote->complained = true;
}

void remote_attend(struct remote *remote, int64_t now_ns) {
    bool wanted =
        remote->needed || answers_wait_for(&remote->viewer->answers_due, remote_number(remote));
    if (wanted)
        remote->needed_ns = now_ns;
    if (is_silent(remote, now_ns))
        break_off(remote, "it says nothing");
    if (!wanted && (!remote->relay || now_ns - remote->needed_ns >= LINGER_NS)) {
        remote_free(remote);
        return;
    }
    if (wanted && !remote->relay && now_ns >= remote->retry_ns)
        open_relay(remote);
    tell_watch(remote);
    complain(remote, now_ns);
}

void remote_ask(struct remote *remote, const arthron_Command *command) {
    if (!remote->relay)
        open_relay(remote);
    remote_say(remote, &(arthron_Page){.which_message = arthron_Page_command_tag,
                                       .message.command = *command});
}

// ---- to the page --------------------------------------------------------------------------------

// True where all of the batch has been passed on.
static bool put_waiting(struct remote *remote, struct live_batch *batch) {
    const struct parcel *parcel = remote->waiting[0];
    uint32_t kind = 0;
    while (remote->at < parcel->size && kind != PASSING_CHUNK) {
        size_t size = passing_first(parcel->bytes + remote->at, parcel->size - remote->at, &kind);
        if (!batch_put(batch, parcel->bytes + remote->at, size))
            return false;
        remote->at += size;
    }
    batch->full |= remote->at < parcel->size;
    return remote->at == parcel->size;
}

void remote_put(struct remote *remote, struct live_batch *batch) {
    if (!remote->waiting_count || !put_waiting(remote, batch))
        return;
    free(remote->waiting[0]);
    remote->waiting[0] = remote->waiting[1];
    remote->waiting_count--;
    remote->at = 0;
    batch->full |= remote->waiting_count > 0;
    say_drawn(remote);
}
