// Random faults of a run: the network's, the disk's, the clocks', of devices, and the ends of
// programs.
#pragma once

#include "random.h"

#include <stdbool.h>
#include <stdint.h>

enum fault {
    FAULT_LOSS,
    FAULT_JITTER,
    FAULT_DOUBLE,
    FAULT_CORRUPT,
    FAULT_CUT_BOTH,
    FAULT_CUT_TO_SERVER,
    FAULT_CUT_TO_STATION,
    FAULT_SERVER_ENDED,
    FAULT_SERVER_HANDED_OVER,
    FAULT_SERVER_KILLED,
    FAULT_SERVER_POWER,
    FAULT_STATION_KILLED,
    FAULT_STATION_RESTARTED,
    FAULT_DISK_FULL,
    FAULT_DISK_SLOW,
    FAULT_DISK_WRITE,
    FAULT_DISK_SYNC,
    FAULT_CLOCK_STEP,
    FAULT_UTC_STEP,
    FAULT_DEVICE,
    FAULT_STALLS,
    FAULT_SECOND_SERVER,
    FAULT_COUNT
};

extern const char *const fault_names[FAULT_COUNT];

void faults_begin(uint64_t seed, int stations);
// Does the next fault, and ends those whose time is over. Call it every so often, until `more` is
// false and it returns true: everything is fair and every program runs.
bool faults_step(bool more);
// When something may happen next, true time.
int64_t faults_next_ns(void);
uint64_t faults_count(enum fault fault);
