// Faults on demand: what goes wrong, with whom, and when. The file (INI) is described in README.md.
#pragma once

#include "base/result.h"

#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>

#define FAULTS_MAX 64
#define FAULT_NAME_MAX 32

enum fault_who { FAULT_MODBUS, FAULT_TRACKER, FAULT_HID, FAULT_WHO_COUNT };

enum fault_what {
    FAULT_DROPOUT,       // says nothing
    FAULT_FREEZE,        // its time stands still: it repeats what it said last
    FAULT_JUMP,          // value: mm, degrees
    FAULT_NOISE,         // value: standard deviation, mm, degrees
    FAULT_NAN,           // what the protocol has for "no number"
    FAULT_LATE,          // value: ms
    FAULT_JITTER,        // value: ms; late by anything up to so much
    FAULT_STALE,         // value: ms; it says what was true so long ago
    FAULT_JUNK,          // random bytes in place of a message
    FAULT_WRONG_SLAVE,   // another slave answers
    FAULT_UNPLUG,        // gone from the bus or network
    FAULT_CLOCK_STEP,    // value: s; its time stamps are off by so much
    FAULT_CLOCK_DRIFT,   // value: s a second
    FAULT_NEWER_VERSION, // messages of a version that does not exist yet
    FAULT_HALF_MESSAGE,  // only the first half of a message
    FAULT_MISSING,       // it says where a tool is, and that this means nothing
    FAULT_WHAT_COUNT
};

struct fault {
    char name[FAULT_NAME_MAX];
    enum fault_who who;
    enum fault_what what;
    double at_s, for_s; // since the start
    double value;
    int every;         // each so-many-th message only; 1: all
    atomic_uint asked; // of messages in its time
};

struct faults {
    int count;
    struct fault list[FAULTS_MAX];
};

// Adds the file's faults. The error names file, line, section and key, or the fault that lacks one.
enum result faults_read(const char *path, struct faults *out_faults, struct error *err);

// The fault that is on at that time, whatever its `every`; NULL: none.
const struct fault *faults_on(const struct faults *faults, enum fault_who who, enum fault_what what,
                              double seconds);

// Does it strike this message? Ask once for each message; safe from several threads.
const struct fault *faults_strike(struct faults *faults, enum fault_who who, enum fault_what what,
                                  double seconds);

// The time that a message tells about: freeze and stale put it back. Ask once for each message.
double faults_time(struct faults *faults, enum fault_who who, double seconds);

// Replaces bytes by random ones (junk), or returns how many of them go out (half message).
size_t faults_spoil(struct faults *faults, enum fault_who who, double seconds, uint8_t *bytes,
                    size_t size);

double faults_noise(void); // standard normal
double faults_share(void); // uniform in [0, 1)

// Logs what begins and ends between two times, and returns when the next does so (seconds since
// the start; infinity: never).
double faults_tell(const struct faults *faults, double from_s, double to_s);
