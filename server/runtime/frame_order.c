#include "runtime/frame_order.h"

#include <string.h>

static uint64_t *word_of(struct frame_order *order, uint64_t number) {
    return &order->came[number % FRAME_ORDER_WINDOW / 64];
}

static uint64_t bit_of(uint64_t number) {
    return UINT64_C(1) << number % 64;
}

// At most FRAME_ORDER_WINDOW numbers lie between settled and newest; none above newest has come.
static uint64_t settle_to(struct frame_order *order, uint64_t number) {
    uint64_t lost = 0;
    for (; order->settled < order->newest && order->settled < number; order->settled++) {
        uint64_t next = order->settled + 1;
        lost += !(*word_of(order, next) & bit_of(next));
        *word_of(order, next) &= ~bit_of(next);
    }
    if (order->settled >= number)
        return lost;
    lost += number - order->settled;
    order->settled = number;
    return lost;
}

static void begin_order(struct frame_order *order, uint64_t number, int64_t now_ns) {
    *order = (struct frame_order){
        .newest = number, .settled = number, .mark = number, .mark_ns = now_ns};
}

enum frame_place frame_order_note(struct frame_order *order, uint64_t number, int64_t now_ns,
                                  uint64_t *out_lost) {
    *out_lost = 0;
    if (!number ||
        (order->newest && number > order->newest && number - order->newest > FRAME_ORDER_JUMP_MAX))
        return FRAME_WRONG;
    if (!order->newest) {
        begin_order(order, number, now_ns);
        return FRAME_NEWEST;
    }
    bool newest = number > order->newest;
    if (!newest && (number <= order->settled || *word_of(order, number) & bit_of(number)))
        return FRAME_OLD;
    if (newest && number - order->settled > FRAME_ORDER_WINDOW)
        *out_lost = settle_to(order, number - FRAME_ORDER_WINDOW);
    *word_of(order, number) |= bit_of(number);
    if (newest)
        order->newest = number;
    return newest ? FRAME_NEWEST : FRAME_LATE;
}

uint64_t frame_order_settle(struct frame_order *order, int64_t now_ns) {
    if (!order->newest || now_ns - order->mark_ns < FRAME_ORDER_PATIENCE_NS)
        return 0;
    uint64_t lost = order->mark > order->settled ? settle_to(order, order->mark) : 0;
    order->mark = order->newest;
    order->mark_ns = now_ns;
    return lost;
}

uint64_t frame_order_end(struct frame_order *order) {
    uint64_t lost = settle_to(order, order->newest);
    memset(order, 0, sizeof *order);
    return lost;
}
