// The order of a connection's frames by their numbers: which is the newest, which are late, and
// which never came. Plain state of one connection; no clock.
#pragma once

#include <stdbool.h>
#include <stdint.h>

// Frames that a late one may be behind the newest.
#define FRAME_ORDER_WINDOW 1024
// A number farther ahead than this is an error of the station, and no loss.
#define FRAME_ORDER_JUMP_MAX 65536
// A number that has not come for so long, and at most for twice as long, is lost.
#define FRAME_ORDER_PATIENCE_NS 500000000LL

struct frame_order {
    uint64_t newest;  // 0: none yet
    uint64_t settled; // each number up to here has come, or is lost
    uint64_t came[FRAME_ORDER_WINDOW / 64];
    uint64_t mark; // the newest at mark_ns: what is to be settled next
    int64_t mark_ns;
};

enum frame_place {
    FRAME_NEWEST, // above all before
    FRAME_LATE,   // below the newest, for the first time
    FRAME_OLD,    // it came before, or so late that it counts as lost
    FRAME_WRONG   // 0, or too far ahead
};

// A zeroed struct frame_order expects any number. *out_lost: numbers that are now known as lost.
enum frame_place frame_order_note(struct frame_order *order, uint64_t number, int64_t now_ns,
                                  uint64_t *out_lost);

// To be called now and then. Returns how many numbers are now known as lost.
uint64_t frame_order_settle(struct frame_order *order, int64_t now_ns);

// The connection has ended: forgets everything. Returns how many numbers never came.
uint64_t frame_order_end(struct frame_order *order);
