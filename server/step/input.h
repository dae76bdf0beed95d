// The inputs of a session.
#pragma once

#include "base/sample.h"
#include "step/job.h"

// Everything that a session learns comes as an input; each step has one.
//
// What is undone at once is a stroke: an instrument's cuts in a row, that is to say
//   of a punch, until its jaw has opened by 0.2 from where it was closed farthest;
//   of a shaver, until its button is let go, or 0.5 s go by without a cut;
//   of a knife, until 0.5 s go by without a cut;
// of each until it is lost, the session is paused, or an undo is asked for: what a bite that is
// going on cuts after that is a stroke of its own. A pause is measured from the last cut of the
// stroke that landed and changed the tissue to the move that the next one cuts, on the clock of the
// inputs. A cut of another instrument in between parts a stroke in two.
enum input_kind {
    INPUT_FRAME, // a station's frame; times in it are on the server's clock
    INPUT_EMPTY, // no frame for 50 ms: only time passes
    INPUT_START,
    INPUT_PAUSE,
    INPUT_STOP,
    INPUT_RESET, // as a new session: metrics and memory at their start, tissue whole, then running
    INPUT_JOB,   // a job of this session is done
    INPUT_UNDO,  // the last stroke is to be undone: a job is asked for when none is on its way
    INPUT_KIND_COUNT
};

const char *input_kind_name(enum input_kind kind);

struct session_input {
    enum input_kind kind;
    int64_t time_ns; // server's monotonic clock, never falling from step to step
    union {
        struct frame frame;                  // INPUT_FRAME
        struct {                             // INPUT_JOB
            uint64_t job;                    // its id
            const struct job_result *result; // read during the step only
        };
    };
};
