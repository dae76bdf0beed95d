// Modbus slaves, over TCP (as behind a gateway) or on one serial line (a pseudo terminal). Their
// registers are listed in README.md.
#pragma once

#include "base/result.h"
#include "drivers/modbus_value.h"
#include "faults.h"
#include "player.h"

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#define SLAVE_MASTERS_MAX 8

struct slave {
    const struct player *player;
    const atomic_bool *stop;
    double update_hz;  // how often the registers change
    int number, count; // ids from `number` on
    enum modbus_order order;
    int baud; // what a master must set on the serial line to be heard; 0: anything
    int stop_bits;
    struct faults *faults;

    struct _modbus *modbus; // what follows belongs to slave.c
    char address[300];      // with the port that was taken; empty: serial
    int listener;           // -1: serial, or unplugged
    int masters[SLAVE_MASTERS_MAX], master_count;
    int capture[2]; // a reply goes through it on its way out, so that a fault can spoil it
    int other_end;  // of the pseudo terminal, kept open so that a master that leaves is no hang-up
    const char *path; // of the link to it, which is there while it is plugged in
};

// Both fill what belongs to slave.c.
enum result slave_listen(struct slave *slave, const char *address, struct error *err);
// Makes a pseudo terminal and the symbolic link `path` to the end that a master opens. A link that
// is there is replaced; anything else is RESULT_REFUSED. `path` is kept.
enum result slave_open_terminal(struct slave *slave, const char *path, struct error *err);

bool slave_knows_baud(int baud); // 9600 to 230400

void *slave_run(void *slave);          // a thread: serves until *stop
void slave_close(struct slave *slave); // nothing where it is not open
