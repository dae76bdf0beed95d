// Computes the metrics of a trainee's session from its steps, live or from a trace. The same steps
// in the same order give the same bits. docs/METRICS.md defines each metric.
//
// struct metrics has constant size and no pointers, so an assignment copies it. Nothing here
// allocates, fails or reads a clock.
#pragma once

#include "base/kept.h"
#include "metrics/force.h"
#include "metrics/hands.h"
#include "metrics/touch.h"
#include "metrics/travel.h"
#include "metrics/view.h"
#include "step/session.h"

// The longest time for which the values of one step count.
#define METRICS_STEP_MAX_NS 100000000LL

// Time constant of the low-pass behind `noticed`: a hand that trembles at a threshold counts as
// past it if it is past it for most of this time.
#define METRICS_NOTICE_NS 250000000LL

enum noticed { NOTICED_TURNED, NOTICED_TILTED, NOTICED_GAIN, NOTICED_ANY, NOTICED_COUNT };

struct instrument_metrics {
    int64_t present_ns;
    int64_t newest_ns; // time of the last new sample
    int64_t samples;   // number of new samples
    struct smooth hand_smooth, seen_smooth;
    struct travel hand, seen;
    struct touch touch;
    int64_t judged_ns;          // present with a known discrepancy; traces of version 2 have none
    double felt[NOTICED_COUNT]; // output of the low-pass: 0 to 1
    int64_t noticed_ns[NOTICED_COUNT];
    int64_t beside_scope_ns; // present together with the scope
    int64_t out_of_view_ns;  // of these, out of the scope's view
    struct search search;
    struct gauge gauge;
    struct force_figures pressed[CASE_GROUPS_MAX]; // while it touched that group
    struct force_figures free;                     // while it touched nothing
};

// A bone with a gauge.
struct bone_metrics {
    struct gauge gauge;
    struct force_figures pressed;
};

struct metrics {
    struct view_optic optic;
    struct instruments tools; // of the session
    int64_t running_ns;
    bool stepped;     // there was a step; the next three are of the last one
    int64_t time_ns;  // its time
    bool running;     // whether the session ran after it
    struct standing { // its values, which count until the next step
        bool present, beside_scope, in_view, judged, noticed[NOTICED_COUNT];
        int nearest;
        double penetration_mm;
    } standing[INSTRUMENT_COUNT];
    struct instrument_metrics instruments[INSTRUMENT_COUNT];
    struct bone_metrics bones[BODY_COUNT];
    struct hands hands;
    bool resected[TISSUES_MAX]; // a job has landed
    struct tissue_figures tissues[TISSUES_MAX];
    uint32_t undone[TISSUES_MAX]; // strokes that were undone
};

void metrics_init(struct metrics *metrics, const struct instruments *tools,
                  struct view_optic optic);

// Keeps metrics, or reads them into new ones of the same session (base/kept.h).
void metrics_keep(struct metrics *metrics, struct kept *kept);

// In a later part of a trace, from what the state keeps with which it begins: no motion is bridged.
// False: what was kept is bad; then they are new.
bool metrics_take_over(struct metrics *metrics, struct kept *kept);

// Adds the session's next step. INPUT_RESET sets all metrics back.
void metrics_step(struct metrics *metrics, const struct session_input *input,
                  const struct session_output *output);

// The same for a step of which only its input and what landed are at hand: of another server.
// is_undo: the job that landed undid a stroke.
void metrics_pass(struct metrics *metrics, enum input_kind kind, const struct landed *landed,
                  bool is_undo);

// Call it where the server was killed and started again: the values of the last step no longer
// count, and no motion is bridged.
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
    METRIC_FORCE_MEAN,
    METRIC_FORCE_PEAK,
    METRIC_FORCE_OK,
    METRIC_FORCE_HELD,
    METRIC_FORCE_LOST,
    METRIC_FORCE_FREE_MEAN,
    METRIC_FORCE_FREE_PEAK,
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
    METRIC_BONE_FORCE_PEAK,
    METRIC_BONE_FORCE_OK,
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
    int version;             // rises when the same steps would give another figure
    bool continuous;         // above its floor it hardly depends on noise, rate and lost samples
    const char *floor;       // in words; "": none
};

extern const struct metric_kind metric_kinds[METRIC_COUNT];

// One figure. An index that does not apply to the metric is -1.
struct metric_value {
    enum metric metric;
    int instrument, group, depth, tissue, along, across;
    const char *owner; // name of the instrument, or of the bone where `instrument` is -1; or NULL.
                       // Valid as long as the metrics
    double value;      // NaN: not defined in this session
    bool below_floor;
};

// Whether a tissue is a C: of another one rim and zones mean nothing. knee: as below.
bool metrics_has_zones(const struct knee_case *knee, int tissue);

// Calls `each` for every figure of the instruments, groups and tissues of this session, in the
// order of enum metric. knee: the session's case; NULL where it is not known, and then each tissue
// has a rim and zones.
void metrics_each(const struct metrics *metrics, const struct knee_case *knee,
                  void (*each)(void *context, const struct metric_value *value), void *context);
