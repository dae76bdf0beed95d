// A sample: one value of one channel at one time. A frame: all samples of a station at one time.
#pragma once

#include "base/joint.h"
#include "base/pose.h"

#include <stdbool.h>
#include <stdint.h>

// What was measured. Values are on the wire and in traces: append only.
enum channel {
    CHANNEL_JOINT,
    CHANNEL_FEMUR,
    CHANNEL_TIBIA,
    CHANNEL_PATELLA,
    CHANNEL_PROBE,
    CHANNEL_PUNCH,
    CHANNEL_SHAVER,
    CHANNEL_KNIFE,
    CHANNEL_SCOPE,
    CHANNEL_FIRST_DESCRIBED, // of the instruments that a station describes (base/instrument.h)
    CHANNEL_LAST_DESCRIBED = CHANNEL_FIRST_DESCRIBED + 2,
    CHANNEL_COUNT
};

#define CHANNEL_FIRST_INSTRUMENT CHANNEL_PROBE
#define INSTRUMENT_COUNT (CHANNEL_COUNT - CHANNEL_FIRST_INSTRUMENT) // that there may be

// "joint", "probe", ...; of a described instrument "instrument_6", unless it was named.
const char *channel_name(enum channel channel);
bool channel_from_name(const char *name, enum channel *out_channel);
bool channel_is_reserved(const char *name); // whether it is that of a channel that is not named

// For instruments_name_channels: the name of a described instrument's channel, at most
// CHANNEL_NAME_MAX - 1 bytes.
#define CHANNEL_NAME_MAX 24
void channel_set_name(enum channel channel, const char *name);

enum sample_kind {
    SAMPLE_JOINT,  // the joint's encoders: channel joint
    SAMPLE_POSE,   // a tracked body or instrument
    SAMPLE_HANDLE, // an instrument's handle: opening and buttons
    SAMPLE_FORCE,  // how hard a body or an instrument is pressed
    SAMPLE_KIND_COUNT
};

// Whether it tells where something is: a pose or the joint's angles.
static inline bool sample_kind_is_motion(enum sample_kind kind) {
    return kind == SAMPLE_JOINT || kind == SAMPLE_POSE;
}

enum validity {
    VALIDITY_OK,   // measured at time_ns
    VALIDITY_HELD, // measured at time_ns, repeated since because the device is silent
    VALIDITY_LOST, // silent for longer than the hold time: the value has no meaning
    VALIDITY_COUNT
};

const char *validity_name(enum validity validity);

// What smoothed a value on its way from the device. Values are on the wire: append only.
enum filter_kind { FILTER_NONE, FILTER_ONE_EURO, FILTER_KIND_COUNT };

struct handle {
    double opening;   // 0 closed, 1 fully open
    uint32_t buttons; // bit i: button i is down
};

struct sample {
    enum channel channel;
    enum sample_kind kind;
    enum validity validity;
    uint8_t device;             // index in the station's list of devices
    uint8_t filter;             // enum filter_kind
    uint16_t filter_latency_us; // that the filter adds; 65535: so much or more
    int64_t time_ns;            // when it was measured, on the station's monotonic clock
    union {
        struct joint_angles joint;
        pose T_mockup_body; // bodies: the bone's frame; instruments: the tip's frame, z along the
                            // shaft away from the handle
        struct handle handle;
        double force_n; // newtons; above 0: pressed, below: pulled
    };
};

#define FORCE_MAX_N 1000

// The joint, three bones with pose and force, five instruments with pose, handle and force; or
// fewer of these and more instruments. More could not go in a datagram (wire/padding.c).
#define FRAME_SAMPLES_MAX 22

struct frame {
    uint64_t number; // counts up from 1 for each connection of a station
    int64_t time_ns; // when the station closed it, on its monotonic clock
    int count;
    struct sample samples[FRAME_SAMPLES_MAX];
};

// True where a frame from outside may be used: counts and enums in range, values finite, rotations
// of unit length, joint angles within ±180 degrees, translations within ±10 m, openings in [0, 1],
// forces within ±FORCE_MAX_N and not of the joint.
bool frame_is_valid(const struct frame *frame);
