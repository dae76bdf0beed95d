#include "sim/streams.h"

#include "base/check.h"
#include "base/clock.h"

#include <stdlib.h>
#include <string.h>

#define ROOM 65536
#define AGAIN_NS (100 * NS_PER_MS)

struct end {
    struct stream_pair *pair;
    const void *owner; // NULL: closed
    enum direction sends;
    struct message *sent, **sent_end; // on their way to the other end
    struct message *came, **came_end;
    size_t on_the_way;
    int64_t last_ns; // nothing overtakes
    bool pumps, over, said_over;
};

struct stream {
    struct end end;
};

struct stream_pair {
    int station;
    struct stream ends[2]; // of the station, of the server
};

static int open_pairs;
static bool silent;

int streams_open(void) {
    return open_pairs;
}

void streams_go_silent(bool is_silent) {
    silent = is_silent;
}

static struct end *other(struct end *end) {
    struct stream_pair *pair = end->pair;
    return end == &pair->ends[0].end ? &pair->ends[1].end : &pair->ends[0].end;
}

static void begin_end(struct stream *stream, struct stream_pair *pair, const void *owner,
                      enum direction sends) {
    struct end *end = &stream->end;
    end->pair = pair;
    end->owner = owner;
    end->sends = sends;
    end->sent_end = &end->sent;
    end->came_end = &end->came;
}

void streams_pair(int station, struct stream **out_a, const void *owner_a, struct stream **out_b,
                  const void *owner_b) {
    struct stream_pair *pair = alloc(1, sizeof *pair);
    pair->station = station;
    begin_end(&pair->ends[0], pair, owner_a, TO_SERVER);
    begin_end(&pair->ends[1], pair, owner_b, TO_STATION);
    *out_a = &pair->ends[0];
    *out_b = &pair->ends[1];
    open_pairs++;
}

static void drop(struct message **first) {
    for (struct message *m; (m = *first);) {
        *first = m->next;
        free(m);
    }
}

static void free_if_done(struct stream_pair *pair) {
    for (int i = 0; i < 2; i++)
        if (pair->ends[i].end.owner || pair->ends[i].end.pumps)
            return;
    for (int i = 0; i < 2; i++) {
        drop(&pair->ends[i].end.sent);
        drop(&pair->ends[i].end.came);
    }
    free(pair);
    open_pairs--;
}

static void deliver(struct end *from, struct end *to) {
    struct message *message = from->sent;
    from->sent = message->next;
    if (!from->sent)
        from->sent_end = &from->sent;
    from->on_the_way -= message->size;
    message->next = NULL;
    if (to->owner) {
        *to->came_end = message;
        to->came_end = &message->next;
        sim_wake(to->owner);
    } else {
        free(message);
    }
    if (from->owner)
        sim_wake(from->owner);
}

static void pump(void *user);

static void pump_at(struct end *end, int64_t at_ns) {
    end->pumps = true;
    sim_at(at_ns, pump, end);
}

static bool is_stopped(const struct end *end) {
    return net_weather(end->pair->station)->cut[end->sends] || silent;
}

static void pump(void *user) {
    struct end *from = user, *to = other(from);
    from->pumps = false;
    while (from->sent && from->sent->due_ns <= sim_now_ns() && !is_stopped(from))
        deliver(from, to);
    if (is_stopped(from) && (from->sent || from->over))
        pump_at(from, sim_now_ns() + AGAIN_NS + net_delay_ns(from->pair->station));
    else if (from->sent)
        pump_at(from, from->sent->due_ns);
    else if (from->over && to->owner && !to->said_over) {
        to->said_over = true;
        sim_wake(to->owner);
    }
    free_if_done(from->pair);
}

void stream_send(struct stream *stream, const void *bytes, size_t size) {
    struct end *end = &stream->end;
    struct message *message = alloc(1, sizeof *message + size);
    int64_t due_ns = sim_now_ns() + net_delay_ns(end->pair->station);
    message->size = size;
    message->due_ns = end->last_ns = due_ns > end->last_ns ? due_ns : end->last_ns;
    memcpy(message->bytes, bytes, size);
    if (sim_is_dead()) {
        free(message);
        return;
    }
    *end->sent_end = message;
    end->sent_end = &message->next;
    end->on_the_way += size;
    if (!end->pumps)
        pump_at(end, message->due_ns);
}

bool stream_has_room(const struct stream *stream) {
    return stream->end.on_the_way < ROOM;
}

struct message *stream_take(struct stream *stream) {
    struct end *end = &stream->end;
    struct message *message = end->came;
    if (!message)
        return NULL;
    end->came = message->next;
    if (!end->came)
        end->came_end = &end->came;
    return message;
}

bool stream_is_over(const struct stream *stream) {
    return stream->end.said_over && !stream->end.came;
}

int stream_station(const struct stream *stream) {
    return stream->end.pair->station;
}

void stream_close(struct stream **stream) {
    struct end *end = &(*stream)->end;
    int64_t due_ns = sim_now_ns() + net_delay_ns(end->pair->station);
    *stream = NULL;
    end->owner = NULL;
    end->over = true;
    if (!end->pumps)
        pump_at(end, due_ns > end->last_ns ? due_ns : end->last_ns);
}
