// The real arthron-mockup as a child process, playing a steady motion: at t seconds of it flexion
// is MOTION_DEG_PER_S · t, the probe's x is MOTION_MM_PER_S · t and the punch's opening is
// MOTION_OPENING_PER_S · t, so that a value tells its time.
#pragma once

#include "base/result.h"
#include "folder.h"

#include <stdint.h>
#include <sys/types.h>

#define MOTION_DEG_PER_S 1.7
#define MOTION_MM_PER_S 20.0
#define MOTION_S 100
#define MOTION_HZ 100 // rows
#define MOTION_OPENING_PER_S (1.0 / MOTION_S)

struct mockup {
    pid_t pid;
    int64_t start_ns; // when it was ready: its time 0
    char folder[FOLDER_MAX], motion[128], serial[128];
    char modbus_tcp[64], tracker[64]; // host:port
    char hid[64];                     // serial number
};

// Makes a folder with the motion and starts the program that lies beside this one; `faults`: the
// text of its --faults file, `rate_hz`: registers' updates, tracker's frames and handle's reports.
// The caller ends it with mockup_end, which also removes the folder.
enum result mockup_start(const char *faults, double rate_hz, struct mockup *out, struct error *err);
// The same without handle and serial line, and with another motion: the joint bends and stretches
// between BEND_LOW_DEG and BEND_HIGH_DEG at BEND_DEG_PER_S, and the probe is fixed to the bone that
// moves: it turns about x as the joint bends. Its registers change BEND_REGISTERS_HZ times a
// second.
#define BEND_LOW_DEG 10
#define BEND_HIGH_DEG 70
#define BEND_DEG_PER_S 60.0
#define BEND_REGISTERS_HZ 4000
enum result mockup_start_bending(const char *faults, double tracker_hz, struct mockup *out,
                                 struct error *err);

void mockup_end(struct mockup *mockup);

// Why it cannot be a handle here; NULL: it is one.
const char *mockup_without_hid(void);
