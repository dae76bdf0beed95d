// What a trainee's session is worth in figures, from its steps as they happen or as a trace has
// them: the same steps in the same order give the same bits. docs/METRICS.md defines each figure.
//
// Constant memory and no pointer: a copy is a copy of the figures so far. Nothing allocates, fails
// or looks at a clock.
#pragma once

#include "metrics/hands.h"
#include "metrics/touch.h"
#include "metrics/travel.h"
#include "metrics/view.h"
#include "step/session.h"

// Where steps are farther apart than this, what stands at the earlier one counts for so long.
#define METRICS_STEP_MAX_NS 100000000LL

// Time constant of what is noticed: a hand that trembles at a threshold is past it where it is so
// for most of this time.
#define METRICS_NOTICE_NS 250000000LL

enum noticed { NOTICED_TURNED, NOTICED_TILTED, NOTICED_GAIN, NOTICED_ANY, NOTICED_COUNT };

struct instrument_metrics {
    int64_t present_ns;
    int64_t newest_ns; // of the last sample that was taken
    int64_t samples;   // how many were
    struct smooth hand_smooth, seen_smooth;
    struct travel hand, seen;
    struct touch touch;
    int64_t judged_ns; // present, and the discrepancy known: traces of version 2 have none
    double felt[NOTICED_COUNT]; // share of the last time past the threshold
    int64_t noticed_ns[NOTICED_COUNT];
    int64_t beside_scope_ns, out_of_view_ns; // present together; and not in the scope's view
    struct search search;
};

struct metrics {
    struct view_optic optic;
    int64_t running_ns;
    bool stepped;     // there was a step,
    int64_t time_ns;  // at this time,
    bool running;     // the session ran from there on,
    struct standing { // and this stood:
        bool present, beside_scope, in_view, judged, noticed[NOTICED_COUNT];
        int nearest;
        double penetration_mm;
    } standing[INSTRUMENT_COUNT];
    struct instrument_metrics instruments[INSTRUMENT_COUNT];
    struct hands hands;
    bool resected[TISSUES_MAX]; // some job landed
    struct tissue_figures tissues[TISSUES_MAX];
    uint32_t undone[TISSUES_MAX]; // strokes that were set back
};

void metrics_init(struct metrics *metrics, struct view_optic optic);

// A session's next step. A reset begins anew.
void metrics_step(struct metrics *metrics, const struct session_input *input,
                  const struct session_output *output);

// The server was killed here and started again: what stood does so no longer, and no motion is
// bridged.
void metrics_interrupt(struct metrics *metrics);

// ---- the figures

enum metric {
    METRIC_TIME,
    METRIC_PRESENT,
    METRIC_PATH_HAND,
    METRIC_PATH_SEEN,
    METRIC_ECONOMY_HAND,
    METRIC_ECONOMY_SEEN,
    METRIC_LDLJ_HAND,
    METRIC_LDLJ_SEEN,
    METRIC_CONTACTS,
    METRIC_CONTACT_TIME,
    METRIC_DEPTH_TIME,
    METRIC_DEPTH_MAX,
    METRIC_OUT_OF_VIEW,
    METRIC_OUT_OF_VIEW_SHARE,
    METRIC_TRIANGULATIONS,
    METRIC_TRIANGULATION_FIRST,
    METRIC_TRIANGULATION_MEAN,
    METRIC_BIMANUAL,
    METRIC_NOTICED_TURN,
    METRIC_NOTICED_TILT,
    METRIC_NOTICED_GAIN,
    METRIC_NOTICED_ANY,
    METRIC_CUTS,
    METRIC_CUTS_REFUSED,
    METRIC_CUTS_UNDONE,
    METRIC_REMOVED,
    METRIC_PLANNED,
    METRIC_OVER,
    METRIC_UNDER,
    METRIC_DAMAGE_LEFT,
    METRIC_RIM,
    METRIC_RIM_STEP,
    METRIC_ZONE_WHOLE,
    METRIC_ZONE_REMOVED,
    METRIC_COUNT
};

struct metric_kind {
    const char *name, *unit; // "1": none
    int version;             // raised where the same steps would give another figure
    bool continuous;         // stands noise, rate and lost samples, above its floor
    const char *floor;       // in words; "" where there is none
};

extern const struct metric_kind metric_kinds[METRIC_COUNT];

// One figure. What it is not about is -1.
struct metric_value {
    enum metric metric;
    int instrument, group, depth, tissue, along, across;
    double value; // NaN: not defined in this session
    bool below_floor;
};

// Each figure of what was there, in the order of the kinds.
void metrics_each(const struct metrics *metrics,
                  void (*each)(void *context, const struct metric_value *value), void *context);
