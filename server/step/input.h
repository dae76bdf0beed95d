// The inputs of a session.
#pragma once

#include "base/sample.h"
#include "step/job.h"

// Everything that a session learns comes as an input. Each step has one.
//
// One undo takes back a stroke, a series of cuts of one instrument. A stroke ends
//   of a jaw: when it has opened by 0.2 from where it was closed farthest;
//   of a burr: when its button is released, or after 0.5 s without a cut;
//   of a blade: after 0.5 s without a cut;
//   of each: when the instrument is lost, the session is paused, an undo is asked for, or another
//   instrument cuts.
// A bite that goes on after that begins a new stroke. The 0.5 s run on the clock of the inputs:
// from the last cut of the stroke that landed and changed the tissue to the next move that cuts.
enum input_kind {
    INPUT_FRAME, // a station's frame; its times are on the server's clock
    INPUT_EMPTY, // no frame for 50 ms: only time passes
    INPUT_START,
    INPUT_PAUSE,
    INPUT_STOP,
    INPUT_RESET, // sets metrics, memory and tissue back to their start; the session then runs
    INPUT_JOB,   // a job of this session is done
    INPUT_UNDO,  // undo the last stroke: the session asks for a job when none is under way
    INPUT_KIND_COUNT
};

const char *input_kind_name(enum input_kind kind);
bool input_is_command(enum input_kind kind); // it is no frame, no job, and not empty

struct session_input {
    enum input_kind kind;
    int64_t time_ns; // on the server's monotonic clock; never less than at the step before
    union {
        struct frame frame;                  // INPUT_FRAME
        struct {                             // INPUT_JOB
            uint64_t job;                    // its id
            const struct job_result *result; // read during the step only
        };
    };
};
