// A Modbus slave, over TCP or on a serial line of its own (a pseudo terminal). Its registers are
// listed in README.md.
#pragma once

#include "base/result.h"
#include "player.h"

#include <stdatomic.h>
#include <stdint.h>

#define SLAVE_MASTERS_MAX 8

struct slave {
    const struct player *player;
    const atomic_bool *stop;
    double update_hz; // how often the registers change
    int number;       // the slave's id
    struct silence silence;
    int late_ms, late_every; // every late_every-th reply comes late_ms late; 0: none

    struct _modbus *line; // what follows belongs to slave.c
    int listener;         // -1: serial
    int masters[SLAVE_MASTERS_MAX], master_count;
    int other_end; // of the pseudo terminal, kept open so that a master that leaves is no hang-up
    const char *link; // to it; removed at the end
    uint64_t replies;
};

// Both fill what belongs to slave.c. *out_port: the port that was taken.
enum result slave_listen(struct slave *slave, const char *address, uint16_t *out_port,
                         struct error *err);
// Makes a pseudo terminal and the symbolic link `path` to the end that a master opens. A link that
// is there is replaced; anything else is RESULT_REFUSED. `path` is kept.
enum result slave_open_terminal(struct slave *slave, const char *path, struct error *err);

void *slave_run(void *slave); // a thread: serves until *stop
void slave_close(struct slave *slave);
