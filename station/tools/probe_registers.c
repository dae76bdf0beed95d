#include "tools/probe_registers.h"

#include "drivers/modbus_value.h"

#include <math.h>

int probe_sequence(const struct probe_block *block) {
    for (int r = 0; r < block->count; r++) {
        bool rises = true;
        for (int i = 1; i < PROBE_READINGS && rises; i++) {
            int step = (int16_t)(block->values[i][r] - block->values[i - 1][r]);
            rises = step > 0 && step < 1000;
        }
        if (rises)
            return r;
    }
    return -1;
}

enum { REGISTERS_PER_LINE = 6 }; // a line of a config has an end

// ---- floats -------------------------------------------------------------------------------------

static double float_at(const struct probe_block *block, int reading, int at,
                       enum modbus_order order) {
    const struct modbus_value value = {.kind = MODBUS_FLOAT, .bits = 32, .scale = 1};
    return modbus_value_number(&value, order, &block->values[reading][at]);
}

// Angles, lengths and counts look like this, other bits hardly ever do in all readings.
static bool is_float(const struct probe_block *block, int at, enum modbus_order order) {
    for (int i = 0; i < PROBE_READINGS; i++) {
        double value = float_at(block, i, at, order);
        double last = float_at(block, i ? i - 1 : 0, at, order);
        if (!(fabs(value) > 1e-3 && fabs(value) < 1e6) ||
            fabs(value - last) > fmax(1, 0.5 * fabs(last)))
            return false;
    }
    return true;
}

static int max(int a, int b) {
    return a > b ? a : b;
}

static int count_floats(const struct probe_block *block, enum modbus_order order) {
    int count = 0;
    for (int r = 0; r + 1 < block->count; r++)
        if (is_float(block, r, order)) {
            count++;
            r++;
        }
    return count;
}

// The words of floats in a row make floats in another order, too, one register further: who knows
// the joint knows which.
static void tell_floats(const struct probe_block *block, FILE *config) {
    int most = 0;
    for (int order = 0; order < MODBUS_ORDER_COUNT; order++)
        most = max(most, count_floats(block, (enum modbus_order)order));
    for (int order = 0; order < MODBUS_ORDER_COUNT && most; order++) {
        if (2 * count_floats(block, (enum modbus_order)order) < most)
            continue;
        int told = 0;
        fprintf(config, "; perhaps, with order = %s:", modbus_order_names[order]);
        for (int r = 0; r + 1 < block->count; r++)
            if (is_float(block, r, (enum modbus_order)order)) {
                fprintf(config, "%s %d f32 (%.6g)", told++ % REGISTERS_PER_LINE ? "" : "\n; ", r,
                        float_at(block, PROBE_READINGS - 1, r, (enum modbus_order)order));
                r++;
            }
        fputs("\n", config);
    }
}

// ---- the section --------------------------------------------------------------------------------

void probe_propose_registers(const struct probe_block *block, bool is_first, FILE *config) {
    static const char *const keys[] = {"flexion", "varus",  "internal",
                                       "shift",   "drawer", "distraction"};
    int sequence = probe_sequence(block);
    bool ours = sequence == 0 && block->count >= 9 && is_first;
    tell_floats(block, config);
    if (sequence >= 0)
        fprintf(config, "sequence = %d\n", sequence);
    if (ours)
        fputs(
            "; a guess, from the registers of arthron-mockup: compare the values with the joint\n",
            config);
    else
        fputs("; name the registers: KEY = REGISTER [SCALE [OFFSET]] [TYPE]\n", config);
    for (int i = 0; i < 6; i++)
        if (ours)
            fprintf(config, "%s = %d 0.01\n", keys[i], i + 1);
        else
            fprintf(config, "; %s =\n", keys[i]);
    if (ours)
        fputs("punch.opening = 7 0.0001\npunch.buttons = 8\n", config);
}
