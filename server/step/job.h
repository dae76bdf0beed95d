// Changes of the tissue that a step asks for, and their results. Cuts take milliseconds: the caller
// runs a job beside the steps (step/operation.h), and a later step takes its result as a whole.
#pragma once

#include "cut/blade.h"
#include "quality/quality.h"
#include "step/touch.h"

#define TISSUES_MAX 4    // groups of a case that can be cut
#define JOB_MOVES_MAX 16 // of one cut

enum job_kind {
    JOB_NONE,
    JOB_CUT,
    JOB_RESTORE, // brings the tissue back to its start
    JOB_UNDO,    // brings the tissue that was cut last back to before the last stroke
    JOB_KIND_COUNT
};

const char *job_kind_name(enum job_kind kind); // "none", "cut", "restore", "undo"

struct job {
    uint64_t id; // counts up from 1 in each session
    enum job_kind kind;
    int tissue;      // index among the case's cuttable groups; JOB_UNDO: any
    uint32_t stroke; // JOB_CUT: successive cuts with the same stroke are undone together
    int move_count;  // JOB_CUT: 1 to JOB_MOVES_MAX
    // JOB_CUT: of one blade, in the frame of the tissue's virtual mesh.
    struct blade_move moves[JOB_MOVES_MAX];
};

enum job_outcome {
    JOB_DONE,    // of a cut: at least one move was made
    JOB_NOTHING, // the blade removed nothing, or there was no cut to undo
    JOB_REFUSED, // the cut cannot be made: nothing changed
    JOB_OUTCOME_COUNT
};

const char *job_outcome_name(enum job_outcome outcome);

// One tissue after its last job. JOB_UNDO restores the figures from before the stroke, except
// mesh_number and refused. Volumes in mm³.
//
// What is touched and what is seen differ where S'' could not follow: a film, tissue that is gone
// altogether, an edge sharper than its triangles. Clefts of tears count in neither.
struct tissue_figures {
    uint32_t mesh_number;   // 1 at the start; rises with each change, also by restore and undo
    uint32_t cuts, refused; // since the tissue was whole
    uint32_t pieces;        // number of pieces that came off
    double volume_mm3;      // of the cut mesh
    double removed_mm3;     // by blades
    double pieces_mm3;      // of the pieces that came off
    double warped_mm3;      // inside S''
    double left_mm3;        // by which S'' is larger than the cut mesh
    double distance_mm;     // from the last cut's surface to S'', the largest of a few points
    double touched_unseen_mm3, seen_untouched_mm3; // inside S'' alone, and inside the tissue alone;
                                                   // 0 where S'' follows by blends
    struct quality_report quality;
};

struct job_result {
    uint64_t job;
    enum job_kind kind;
    enum job_outcome outcome;
    int tissue; // of JOB_UNDO: the tissue of the stroke
    struct tissue_figures figures;
    struct touch_change touch;
    // Of a cut that is JOB_DONE; else empty. For a cut of several moves it has only the pieces.
    struct cut_change change;
    uint64_t hash;       // of vertices and triangles that changed, and of a touch by blends
    uint64_t touch_hash; // of a touch by offsets (step/touch.h)
    uint32_t cuts_back;  // JOB_UNDO: number of cuts that were undone,
    double mm3_back;     // and the volume that they had removed
    bool more; // JOB_UNDO: the stroke also cut another tissue, which the next JOB_UNDO restores
    struct error why; // JOB_REFUSED
};

// Keeps a job, or reads one. A cut's blade is one of the instruments that cut.
void job_keep(struct job *job, int tissues, const struct instruments *instruments,
              struct kept *kept);
// Whether an operation of so many tissues can run it: it may be from anywhere.
bool job_is_valid(const struct job *job, int tissues, const struct instruments *instruments);
void blade_move_keep(struct blade_move *move, const struct instruments *instruments,
                     struct kept *kept);

void job_result_destroy(struct job_result **result); // NULL inside is fine
