// Streams between a station and the server, under the control connections. While the network is cut
// nothing arrives; afterwards everything does, in order, as with TCP.
#pragma once

#include "sim/net.h"

struct stream; // one end

struct message {
    struct message *next;
    int64_t due_ns;
    size_t size;
    uint8_t bytes[];
};

void streams_begin(void);
// Both ends of a new one; sim_wake(owner) where there is something to do.
void streams_pair(int station, struct stream **out_a, const void *owner_a, struct stream **out_b,
                  const void *owner_b);
void stream_close(struct stream **end); // the other end is told
void stream_send(struct stream *end, const void *bytes, size_t size);
bool stream_has_room(const struct stream *end);
struct message *stream_take(struct stream *end); // which the caller frees; NULL: none
bool stream_is_over(const struct stream *end);   // and all was taken
int stream_station(const struct stream *end);
// The server's machine went without a word: the other ends learn of it once they send and the
// machine is there again.
void streams_go_silent(bool silent);
int streams_open(void);
