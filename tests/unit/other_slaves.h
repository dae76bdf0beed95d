// Modbus slaves of another make: frames by the published specification, without libmodbus. On a
// serial line (a pseudo terminal), or behind a gateway (TCP).
#pragma once

#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

enum { OTHER_SLAVES = 3, OTHER_INPUTS = 8, OTHER_REPLY_MAX = 300 };

// Holding register r of slave s is 1000 · s + r, input register r is inputs[r]. A request that
// comes before the last one was answered is a collision.
struct other_slaves {
    char name[64]; // of the line: a path, or host:port
    uint16_t inputs[OTHER_INPUTS];
    atomic_bool echo; // the adapter hears what it sends
    atomic_int collisions, connections;
    struct {
        atomic_bool silent;
        atomic_int asked, delay_ms; // delay_ms: its replies come so late, and others between
        atomic_int spoil_every;     // each so-many-th checksum is wrong; 0: none
        atomic_int drip_ms;         // its replies come byte by byte, so far apart; 0: at once
    } each[OTHER_SLAVES + 1];

    pthread_t thread; // what follows belongs to other_slaves.c
    atomic_bool stop;
    bool is_tcp;
    int fd, other_end, listener;
    struct other_late {
        int64_t due_ns; // 0: none
        int size, sent;
        uint8_t bytes[OTHER_REPLY_MAX];
    } late[OTHER_SLAVES + 1];
};

void other_slaves_start(struct other_slaves *slaves);
void other_slaves_start_gateway(struct other_slaves *slaves);
void other_slaves_stop(struct other_slaves *slaves);
