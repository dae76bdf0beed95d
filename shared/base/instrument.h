// What instruments are: their kind, the part that cuts or touches, their handle, how they look. The
// first five are built in, and their places are the channels from CHANNEL_PROBE on. A station may
// describe more.
#pragma once

#include "base/result.h"
#include "base/sample.h"

#define INSTRUMENT_NAME_MAX 24 // with the final 0
#define INSTRUMENTS_USUAL 5    // probe, punch, shaver, knife, scope
#define INSTRUMENTS_DESCRIBED_MAX (INSTRUMENT_COUNT - INSTRUMENTS_USUAL)

// Values are on the wire and in traces: append only.
enum instrument_kind {
    INSTRUMENT_TIP,   // touches: a probe
    INSTRUMENT_JAW,   // closes: a punch, or a grasper that does not cut
    INSTRUMENT_BURR,  // turns: a shaver
    INSTRUMENT_BLADE, // cuts as it moves: a knife, a curette
    INSTRUMENT_OPTIC, // sees: a scope
    INSTRUMENT_KIND_COUNT
};

const char *instrument_kind_name(enum instrument_kind kind); // "tip", "jaw", ...

// Lengths of what a kind does not have are 0.
struct instrument {
    char name[INSTRUMENT_NAME_MAX];
    enum instrument_kind kind;
    bool cuts; // of a jaw: else it grasps. A burr and a blade do, a tip and an optic do not
    // Of a burr: the handle's button with which it turns. Of a jaw: the one that closes it; -1: it
    // is as open as the handle.
    int button;
    double length_mm;    // jaw: from the hinge to the tip; blade: along the shaft
    double width_mm;     // jaw: across; burr: its diameter; blade: from edge to back
    double thickness_mm; // blade: its kerf
    double opening_deg;  // jaw: the angle of the open one
    uint32_t colour;     // 0xRRGGBB of its shaft; INSTRUMENT_PLAIN: as the page likes
};

#define INSTRUMENT_PLAIN 0xffffffffu

struct instruments {
    int count;                              // at least INSTRUMENTS_USUAL
    struct instrument of[INSTRUMENT_COUNT]; // [channel - CHANNEL_FIRST_INSTRUMENT]
};

// The five, with the sizes of today's.
const struct instruments *instruments_usual(void);

// A grasper for loose bodies, as a station may describe it: "grasper", a jaw that does not cut.
struct instrument instrument_grasper(void);

// The five and that grasper: what the hands of a motion hold.
const struct instruments *instruments_of_hands(void);

// A typical one of its kind, without a name.
struct instrument instrument_of_kind(enum instrument_kind kind);

// Whether it takes tissue away.
bool instrument_cuts(const struct instrument *instrument);

// How open its jaw is, from 0 to 1: by the handle's opening or by its button.
double instrument_opening(const struct instrument *instrument, const struct handle *handle);

// For a program that is about one station or one session, before its threads start: channel_name
// and channel_from_name use the names of these from now on.
void instruments_name_channels(const struct instruments *instruments);

// Whether both describe the same ones in the same order.
bool instruments_equal(const struct instruments *a, const struct instruments *b);

// Adds a described one. RESULT_LIMIT: there is no room. RESULT_INVALID: the name is not 1 to 23 of
// a-z, 0-9, - and _ after a letter, or is taken by a channel or another instrument, or is how
// exports call something of one (probe_warped, virtual_femur); a size is not a number in its range.
// The error names the instrument, and what.
enum result instruments_add(struct instruments *instruments, const struct instrument *instrument,
                            struct error *err);
