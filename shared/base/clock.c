#include "base/clock.h"

#include <stdio.h>
#include <time.h>

#define DRIFT_PER_NS 1e-4
#define STEP_NS NS_PER_MS // less is no step

static int64_t read_clock(clockid_t id) {
    struct timespec now;
    clock_gettime(id, &now);
    return now.tv_sec * NS_PER_S + now.tv_nsec;
}

int64_t clock_now_ns(void) {
    return read_clock(CLOCK_MONOTONIC);
}

int64_t clock_utc_ns(void) {
    return read_clock(CLOCK_REALTIME);
}

void clock_utc_text(int64_t utc_ns, char out[32]) {
    time_t seconds = (time_t)(utc_ns / NS_PER_S);
    struct tm utc;
    gmtime_r(&seconds, &utc);
    size_t used = strftime(out, 32, "%Y-%m-%dT%H:%M:%S", &utc);
    snprintf(out + used, 32 - used, ".%03dZ", (int)(utc_ns % NS_PER_S / NS_PER_MS));
}

static int64_t uncertainty_of(const struct clock_exchange *e, int64_t now_ns) {
    int64_t age = now_ns > e->local_ns ? now_ns - e->local_ns : 0;
    return e->round_trip_ns / 2 + (int64_t)((double)age * DRIFT_PER_NS);
}

// Each exchange bounds the offset from both sides.
static bool is_stepped(const struct clock_offset *o, int64_t offset_ns, int64_t round_trip_ns,
                       int64_t now_ns) {
    int64_t known_ns, uncertainty_ns;
    if (!clock_offset_get(o, now_ns, &known_ns, &uncertainty_ns))
        return false;
    int64_t apart_ns = offset_ns > known_ns ? offset_ns - known_ns : known_ns - offset_ns;
    return apart_ns > uncertainty_ns + round_trip_ns / 2 + STEP_NS;
}

bool clock_offset_add(struct clock_offset *o, int64_t sent_ns, int64_t remote_received_ns,
                      int64_t remote_sent_ns, int64_t received_ns) {
    int64_t round_trip = (received_ns - sent_ns) - (remote_sent_ns - remote_received_ns);
    if (round_trip < 0 || received_ns < sent_ns || remote_sent_ns < remote_received_ns)
        return false;
    int64_t offset = ((remote_received_ns - sent_ns) + (remote_sent_ns - received_ns)) / 2;
    if (is_stepped(o, offset, round_trip, received_ns))
        *o = (struct clock_offset){0};
    o->exchanges[o->next] = (struct clock_exchange){offset, round_trip, received_ns};
    o->next = (o->next + 1) % CLOCK_OFFSET_WINDOW;
    if (o->count < CLOCK_OFFSET_WINDOW)
        o->count++;
    return true;
}

int64_t clock_offset_round_trip_ns(const struct clock_offset *o) {
    int64_t sorted[CLOCK_OFFSET_WINDOW];
    for (int i = 0; i < o->count; i++) {
        int at = i;
        for (; at > 0 && sorted[at - 1] > o->exchanges[i].round_trip_ns; at--)
            sorted[at] = sorted[at - 1];
        sorted[at] = o->exchanges[i].round_trip_ns;
    }
    return o->count ? sorted[(o->count - 1) / 2] : 0;
}

bool clock_offset_get(const struct clock_offset *o, int64_t now_ns, int64_t *out_offset_ns,
                      int64_t *out_uncertainty_ns) {
    if (!o->count)
        return false;
    const struct clock_exchange *best = &o->exchanges[0];
    for (int i = 1; i < o->count; i++)
        if (uncertainty_of(&o->exchanges[i], now_ns) < uncertainty_of(best, now_ns))
            best = &o->exchanges[i];
    *out_offset_ns = best->offset_ns;
    *out_uncertainty_ns = uncertainty_of(best, now_ns);
    return true;
}
