// Changes of the tissue that a step asks for, and their results. Cuts take milliseconds: the caller
// runs a job beside the steps (step/operation.h), and a later step takes its result as a whole.
#pragma once

#include "cut/blade.h"
#include "quality/quality.h"

#define TISSUES_MAX 4    // groups of a case that can be cut
#define JOB_MOVES_MAX 16 // of one cut

enum job_kind {
    JOB_NONE,
    JOB_CUT,
    JOB_RESTORE, // the tissue as it was at the start
    JOB_UNDO,    // the tissue that was cut last as it was before the last stroke
    JOB_KIND_COUNT
};

const char *job_kind_name(enum job_kind kind); // "none", "cut", "restore", "undo"

struct job {
    uint64_t id; // counts up from 1 in each session
    enum job_kind kind;
    int tissue;      // index among the case's cuttable groups; JOB_UNDO: any
    uint32_t stroke; // JOB_CUT: cuts in a row that have the same are undone together
    int move_count;  // JOB_CUT: 1 to JOB_MOVES_MAX
    // JOB_CUT: of one blade, in the frame of the tissue's virtual mesh.
    struct blade_move moves[JOB_MOVES_MAX];
};

enum job_outcome {
    JOB_DONE,    // of a cut's moves at least one was made
    JOB_NOTHING, // the blade took nothing; no cut is there to be undone
    JOB_REFUSED, // the cut cannot be made: nothing changed
    JOB_OUTCOME_COUNT
};

const char *job_outcome_name(enum job_outcome outcome);

// One tissue after its last job. JOB_UNDO restores the figures from before the stroke, except
// mesh_number and refused. Volumes in mm³.
struct tissue_figures {
    uint32_t mesh_number;   // 1 at the start; each change makes the next, also restoring, undoing
    uint32_t cuts, refused; // since it was whole
    uint32_t pieces;        // that came off
    double volume_mm3;      // of the cut mesh
    double removed_mm3;     // by blades
    double pieces_mm3;      // came off
    double warped_mm3;      // inside S''
    double left_mm3;        // by which S'' is still too large
    double distance_mm;     // from the last cut's surface to S'', the largest of a few points
    struct quality_report quality;
};

struct job_result {
    uint64_t job;
    enum job_kind kind;
    enum job_outcome outcome;
    int tissue; // of JOB_UNDO that whose cut it was
    struct tissue_figures figures;
    uint32_t blend_count; // vertices of the physical surface whose blend changed
    uint32_t *vertices;   // ascending
    double *blends;
    // Of a cut that is JOB_DONE, else empty. Of a cut of several moves it has the pieces alone.
    struct cut_change change;
    uint64_t hash;            // of blends, and of vertices and triangles that changed
    uint32_t cuts_back;       // by JOB_UNDO, and the volume that came back with them
    double mm3_back;
    bool more; // JOB_UNDO: of that stroke there are cuts of another tissue, for the next JOB_UNDO
    struct error why; // JOB_REFUSED
};

void job_result_destroy(struct job_result **result); // NULL inside is fine
