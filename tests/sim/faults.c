#include "sim/faults.h"

#include "base/clock.h"
#include "sim/disk.h"
#include "sim/hall.h"
#include "sim/report.h"
#include "sim/station.h"

#include <string.h>

#define GOING 16 // faults at the same time

const char *const fault_names[FAULT_COUNT] = {
    "datagrams lost",     "datagrams late",    "datagrams doubled",   "datagrams corrupted",
    "network cut",        "cut to the server", "cut to a station",    "server ended",
    "server handed over", "server killed",     "server lost power",   "station killed",
    "station restarted",  "disk full",         "disk slow",           "writes failed",
    "fdatasync failed",   "clock stepped",     "time of day stepped", "device silent",
    "threads held up",    "second server",
};

struct going {
    enum fault fault;
    int station, device;
    int64_t until_ns; // 0: none
};

static struct {
    struct random random;
    int stations;
    int64_t next_ns;
    struct going going[GOING];
    uint64_t counts[FAULT_COUNT];
} faults;

static uint64_t below(uint64_t limit) {
    return random_bits(&faults.random) % limit;
}

static int64_t between_ms(int64_t low, int64_t high) {
    return (low + (int64_t)below((uint64_t)(high - low + 1))) * NS_PER_MS;
}

void faults_begin(uint64_t seed, int stations) {
    memset(&faults, 0, sizeof faults);
    faults.random = (struct random){seed};
    faults.stations = stations;
    faults.next_ns = sim_now_ns() + between_ms(500, 4000);
}

uint64_t faults_count(enum fault fault) {
    return faults.counts[fault];
}

// ---- what lasts ---------------------------------------------------------------------------------

static void set(const struct going *g, bool on) {
    struct weather *w = net_weather(g->station), fair = net_fair(g->station);
    switch (g->fault) {
    case FAULT_LOSS:
        w->lost = on ? random_between(&faults.random, 0.02, 0.7) : 0;
        break;
    case FAULT_JITTER:
        w->jitter_ns = on ? between_ms(5, 150) : fair.jitter_ns;
        w->delay_ns = on ? between_ms(0, 80) : fair.delay_ns;
        break;
    case FAULT_DOUBLE:
        w->doubled = on ? random_between(&faults.random, 0.1, 1) : 0;
        break;
    case FAULT_CORRUPT:
        w->corrupted = on ? random_between(&faults.random, 0.02, 0.6) : 0;
        break;
    case FAULT_CUT_BOTH:
        w->cut[TO_SERVER] = w->cut[TO_STATION] = on;
        break;
    case FAULT_CUT_TO_SERVER:
        w->cut[TO_SERVER] = on;
        break;
    case FAULT_CUT_TO_STATION:
        w->cut[TO_STATION] = on;
        break;
    case FAULT_DISK_FULL:
        disk_faults.full = on;
        break;
    case FAULT_DISK_SLOW:
        disk_faults.slow_ns = on ? between_ms(20, 1500) : 0;
        break;
    case FAULT_DISK_WRITE:
        disk_faults.fails_write = on;
        break;
    case FAULT_DISK_SYNC:
        disk_faults.fails_sync = on;
        break;
    case FAULT_DEVICE:
        station_silence(g->station, g->device, on);
        break;
    case FAULT_STALLS:
        sim_stalls.on = on;
        break;
    default:
        break;
    }
}

static int64_t length_of(enum fault fault) {
    switch (fault) {
    case FAULT_CUT_BOTH:
    case FAULT_CUT_TO_SERVER:
    case FAULT_CUT_TO_STATION:
        return between_ms(50, below(8) ? 7000 : 45000); // some longer than a session waits
    case FAULT_DEVICE:
        return between_ms(10, 3000);
    default:
        return between_ms(200, 9000);
    }
}

static bool is_going(enum fault fault, int station) {
    for (int i = 0; i < GOING; i++) {
        const struct going *g = &faults.going[i];
        bool cuts = g->fault >= FAULT_CUT_BOTH && g->fault <= FAULT_CUT_TO_STATION &&
                    fault >= FAULT_CUT_BOTH && fault <= FAULT_CUT_TO_STATION;
        if (g->until_ns && (g->fault == fault || cuts) && g->station == station)
            return true;
    }
    return false;
}

static void begin_lasting(enum fault fault, int station) {
    if (fault == FAULT_STALLS || (fault >= FAULT_DISK_FULL && fault <= FAULT_DISK_SYNC))
        station = 0;
    for (int i = 0; i < GOING && !is_going(fault, station); i++) {
        struct going *g = &faults.going[i];
        if (g->until_ns)
            continue;
        *g = (struct going){fault, station, (int)below(STATION_DEVICES),
                            sim_now_ns() + length_of(fault)};
        faults.counts[fault]++;
        happened("fault: %s, room-%d, %.1f s", fault_names[fault], station + 1,
                 (double)(g->until_ns - sim_now_ns()) / NS_PER_S);
        set(g, true);
        return;
    }
}

// False: some go on.
static bool end_lasting(bool all) {
    bool none = true;
    for (int i = 0; i < GOING; i++) {
        struct going *g = &faults.going[i];
        if (!g->until_ns)
            continue;
        if (all || g->until_ns <= sim_now_ns()) {
            happened("fault over: %s, room-%d", fault_names[g->fault], g->station + 1);
            g->until_ns = 0;
            set(g, false);
        } else {
            none = false;
        }
    }
    return none;
}

// ---- what is done at once -----------------------------------------------------------------------

static void end_server(enum fault fault) {
    static const enum hall_death deaths[] = {DEATH_ENDED, DEATH_HANDED_OVER, DEATH_KILLED,
                                             DEATH_POWER};
    enum hall_death death = deaths[fault - FAULT_SERVER_ENDED];
    bool at_once = death == DEATH_KILLED || death == DEATH_POWER;
    if (hall_has_ended() || (!at_once && !hall_is_up()))
        return; // a start may be cut short by a kill alone
    faults.counts[fault]++;
    hall_end(death);
}

static void step_clock(int station, bool utc) {
    struct sim_process *process = station_process(station);
    int64_t by_ns = utc ? between_ms(-100000, 100000) : between_ms(-4000, 6000);
    happened("fault: the %s of room-%d steps by %.3f s", utc ? "time of day" : "clock", station + 1,
             (double)by_ns / NS_PER_S);
    faults.counts[utc ? FAULT_UTC_STEP : FAULT_CLOCK_STEP]++;
    if (utc)
        process->utc_ahead_ns += by_ns;
    else
        process->ahead_ns += by_ns;
}

static void end_station(enum fault fault, int station) {
    if (station_has_ended(station))
        return;
    faults.counts[fault]++;
    if (fault == FAULT_STATION_KILLED)
        station_kill(station);
    else
        station_stop(station);
}

static void try_second_server(void) {
    if (!hall_is_up())
        return;
    faults.counts[FAULT_SECOND_SERVER]++;
    hall_try_second();
}

static void begin_one(enum fault fault) {
    int station = (int)below((uint64_t)faults.stations);
    if (fault >= FAULT_SERVER_ENDED && fault <= FAULT_SERVER_POWER)
        end_server(fault);
    else if (fault == FAULT_STATION_KILLED || fault == FAULT_STATION_RESTARTED)
        end_station(fault, station);
    else if (fault == FAULT_SECOND_SERVER)
        try_second_server();
    else if (fault == FAULT_CLOCK_STEP || fault == FAULT_UTC_STEP)
        step_clock(station, fault == FAULT_UTC_STEP);
    else
        begin_lasting(fault, station);
}

// ---- all ----------------------------------------------------------------------------------------

static bool start_again(bool all) {
    bool up = hall_is_up();
    if (hall_has_ended() && (all || below(3) == 0))
        hall_start();
    for (int i = 0; i < faults.stations; i++)
        if (station_has_ended(i)) {
            up = false;
            if (all || below(3) == 0)
                station_start(i);
        }
    return up;
}

bool faults_step(bool more) {
    bool fair = end_lasting(!more) & start_again(!more);
    if (more && sim_now_ns() >= faults.next_ns) {
        begin_one((enum fault)below(FAULT_COUNT));
        faults.next_ns = sim_now_ns() + between_ms(20, below(4) ? 1500 : 8000);
    }
    return fair;
}

int64_t faults_next_ns(void) {
    int64_t next_ns = sim_now_ns() + 250 * NS_PER_MS;
    if (faults.next_ns < next_ns && faults.next_ns > sim_now_ns())
        next_ns = faults.next_ns;
    for (int i = 0; i < GOING; i++)
        if (faults.going[i].until_ns > sim_now_ns() && faults.going[i].until_ns < next_ns)
            next_ns = faults.going[i].until_ns;
    return next_ns;
}
