// A file that holds several parts of a knee: its components, and names for them.
#pragma once

#include "base/joint.h"
#include "import/frame.h"
#include "import/reader.h"

#define IMPORT_PARTS_MAX 32
// Of the largest component's area: smaller ones are left out.
#define IMPORT_PART_SHARE 0.002

#define IMPORT_SPECKS_MAX 8

struct import_speck {
    uint32_t triangles;
    vec3 centre; // of its box, in the file's units
};

struct import_parts {
    int count; // by falling area
    uint32_t left_out;
    struct import_speck specks[IMPORT_SPECKS_MAX]; // the largest of those left out
    struct import_arrays parts[IMPORT_PARTS_MAX];
    char names[IMPORT_PARTS_MAX][64]; // "" before import_name_parts
};

// Components are connected by shared vertices, and by those of open edges that lie in one place, as
// where normals differ. A surface inside of another one that runs the other way round, as around
// marrow, stays with it. RESULT_LIMIT: more than IMPORT_PARTS_MAX. The caller releases
// *out_parts with import_parts_fini, also after an error.
enum result import_split(const struct import_arrays *arrays, struct import_parts *out_parts,
                         struct error *err);
void import_parts_fini(struct import_parts *parts);

// The right-handed axes, as three letters, in which most parts get a name. A patella must be among
// them, for it tells the front; RAS where there is none.
void import_guess_axes(struct import_parts *parts, char out_letters[4]);

// Names by place, size and shape, in any unit: of the two largest that lie above one another the
// upper one is the femur, the other the tibia; the patella lies before and above; the menisci lie
// between the bones, with an open middle, as plates of cartilage have none; the fibula stands
// beside the tibia. All others are part_1, part_2, ... side: "left", "right", or
// NULL: by the fibula. Refused where menisci are there and nothing tells which is lateral, or where
// there are no two bones above one another.
enum result import_name_parts(struct import_parts *parts, const struct import_frame *frame,
                              const char *side, struct error *err);
