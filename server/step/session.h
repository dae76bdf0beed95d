// One trainee, one case: what turns samples into warped poses.
//
// A step is a function of the session and its input: no clock, no file, no socket, no thread, no
// allocation. The same inputs give the same bytes, which is what a trace replays.
#pragma once

#include "base/sample.h"
#include "case/case.h"
#include "step/discrepancy.h"
#include "step/operation.h"
#include "warp/adaptive.h"
#include "warp/avatar.h"

// A case prepared for sessions: surfaces, search structures, tissue that can be cut. Immutable; any
// number of sessions on any threads share one. Takes ownership of *knee (which becomes NULL) where
// it succeeds. RESULT_INVALID where a tear leaves no tissue, a case has more than TISSUES_MAX
// cuttable groups, or a torn ligament's key is not met (warp/adaptive.h).
struct scene;

enum result scene_create(struct knee_case **knee, struct scene **out_scene, struct error *err);
void scene_destroy(struct scene **scene);
const struct knee_case *scene_case(const struct scene *scene);
int scene_tissue_count(const struct scene *scene);
int scene_tissue_group(const struct scene *scene, int tissue); // its index in the case's groups

// The adaptive warp of a case's torn ligaments, which the caller destroys. RESULT_INVALID, naming
// the key, where one is not met.
enum result scene_adaptive(const struct knee_case *knee, enum adaptive_kind kind,
                           struct adaptive **out_adaptive, struct error *err);

// The case as the kernels see it at one pose of the joint, before any cut, the femur at the
// identity: for checks and benches. Must not move in memory.
struct scene_stance {
    pose T_femur_body[BODY_COUNT];
    pose correction[BODY_COUNT]; // M
    struct adaptive_warp adaptive;
    struct warp_scene warp;
};

void scene_stand(const struct scene *scene, enum adaptive_kind kind,
                 const struct joint_angles *joint, struct scene_stance *out_stance);

// What an instrument is made of, for contacts beside its tip (warp/avatar.h).
struct instrument_body {
    int point_count; // 1 to AVATAR_POINTS_MAX; the first is the tip
    struct avatar_point points[AVATAR_POINTS_MAX];
};

// Counts in range, places within 300 mm of the tip, radii from 0 to 20 mm, the first at the origin.
bool instrument_body_is_valid(const struct instrument_body *body);

struct session_settings {
    struct field field;
    enum adaptive_kind adaptive;
    enum avatar_mode avatar; // without a portal in the case: tip
    struct instrument_body bodies[INSTRUMENT_COUNT];
    int64_t hold_ns; // how long a sample that stopped coming stands for the newest
    // A cut's new warp is eased in: in one step the displacement at a tip may change by this share
    // of the tip's own way, and by so much for each second.
    double ease_share;
    double ease_mm_s;
};

// Inverse-distance with a skin of 0.1 mm, hinge, tip, 100 ms, 0.2, 2 mm/s; straight instruments
// with a point every 7 mm of the 49 mm behind the tip.
struct session_settings session_settings_default(void);

enum session_state {
    SESSION_WAITING,
    SESSION_RUNNING,
    SESSION_PAUSED,
    SESSION_CLOSED,
    SESSION_STATE_COUNT
};

const char *session_state_name(enum session_state state);

// All that a session learns comes as an input, one for each step.
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

struct instrument_output {
    bool present;            // a pose was known at this step; else all below is 0
    enum validity validity;  // of that pose
    pose T_mockup_tip;       // as measured
    pose T_mockup_warped;    // as to be shown
    struct warp warp;        // the space warp at the tip, in the mock-up's frame
    struct avatar_lead lead; // how T_mockup_warped goes on, in the mock-up's frame
    double penetration_mm;   // of the body, and
    double tip_gap_mm;       // of its tip: warp/avatar.h
    struct discrepancy discrepancy;
    struct handle handle;          // the last known; 0 where the instrument never had one
    enum validity handle_validity; // lost where it has none
};

enum event {
    EVENT_STATE = 1 << 0,       // the session's state changed
    EVENT_DEVICE_LOST = 1 << 1, // a sample went from ok or held to lost
    EVENT_DEVICE_BACK = 1 << 2,
    EVENT_CONTACT = 1 << 3, // an instrument came within 0.2 mm of a surface
    EVENT_RELEASE = 1 << 4, // and left it by more than 0.4 mm
    EVENT_CUT = 1 << 5,     // a cut changed the tissue: it has landed
    EVENT_PIECE = 1 << 6,   // and a piece came off
    EVENT_REFUSED = 1 << 7, // a cut was refused
    EVENT_UNDONE = 1 << 8   // a stroke was undone: its tissue is as it was before, this has landed
};

#define EVENT_COUNT 9

const char *event_name(int bit); // 0 "state", 1 "device_lost", ...

// A job's outcome as it takes effect.
struct landed {
    uint64_t job; // 0: nothing landed at this step
    enum job_outcome outcome;
    int tissue;
    struct tissue_figures figures;
    uint64_t hash; // of the result's meshes and blends
};

struct session_output {
    uint64_t step;         // counts up from 1
    uint64_t frame_number; // of the input, 0 where it was no frame
    int64_t time_ns;
    enum session_state state;
    uint32_t events; // enum event, or-ed
    struct joint_angles joint;
    enum validity joint_validity;
    pose T_mockup_body[BODY_COUNT];
    // Where the virtual bones are: the tibia elsewhere where its ligaments are torn.
    pose T_mockup_virtual[BODY_COUNT];
    // Of the case's torn ligaments: how far each is put to the test, and what is given of its extra
    // motion (warp/adaptive.h).
    int torn_count;
    double opening[ADAPTIVE_LIGAMENTS_MAX], share[ADAPTIVE_LIGAMENTS_MAX];
    struct instrument_output instruments[INSTRUMENT_COUNT]; // [channel - CHANNEL_FIRST_INSTRUMENT]
    struct job job;       // to be run; id 0: none. At most one is on its way at any time
    struct landed landed; // at this step
    uint64_t hash;        // of all above and of the hash of the step before
};

struct session;

// The caller runs the job of an output (operation_run) beside the steps and gives its result to the
// session with INPUT_JOB, or the id alone where the result is lost. The scene must outlive the
// session.
struct session *session_create(const struct scene *scene, const struct session_settings *settings);
void session_destroy(struct session **session);

// Frame numbers must rise: dropping older ones is the caller's work (the hub counts them).
void session_step(struct session *session, const struct session_input *input,
                  struct session_output *out);
