// The server's disk: real files in memory, and beside each what of it would survive a loss of
// power. A page (4 KB) that was written is dirty until fdatasync; one that a failed fdatasync
// leaves behind counts as clean and may be lost, as Linux does it.
#pragma once

#include "sim/threads.h"

#include <stddef.h>

struct disk_faults {
    bool full;        // nothing can be written
    bool fails_write; // now and then a write fails, or writes a part
    bool fails_sync;  // fdatasync fails
    int64_t slow_ns;  // every operation takes up to so long
};

extern struct disk_faults disk_faults;

struct disk_counts {
    uint64_t writes, syncs, refused_writes, failed_syncs, pages_lost;
};

// dir: where the files are that count. It must be there.
void disk_begin_run(uint64_t seed, const char *dir);
void disk_end_run(void);
struct disk_counts disk_counts(void);

// When something last went wrong or took long; for what may be missing.
int64_t disk_trouble_ns(void);

// The machine has lost its power: files are what had reached the disk, and some pages more.
void disk_lose_power(void);
