// What a group of a case is for people, checks and pictures. A case describes it (case.json); what
// it leaves out follows from the group's name.
#pragma once

#include <stdbool.h>
#include <stdint.h>

#define TISSUE_LABEL_MAX 64 // with the final 0

// Values are on the wire: append only.
enum tissue_kind {
    TISSUE_OTHER, // a loose body, for instance
    TISSUE_BONE,
    TISSUE_CARTILAGE,
    TISSUE_MENISCUS,
    TISSUE_LIGAMENT, // and tendons
    TISSUE_SYNOVIUM, // the joint's lining and its folds: a plica
    TISSUE_SKIN,
    TISSUE_KIND_COUNT
};

enum tissue_side { TISSUE_NO_SIDE, TISSUE_MEDIAL, TISSUE_LATERAL, TISSUE_SIDE_COUNT };

struct case_tissue {
    enum tissue_kind kind;
    enum tissue_side side; // of the knee, where it is of one
    bool has_zones;        // a C from above, of which quality tells horns, body and rim
    uint32_t colour;       // 0xRRGGBB
    char label[TISSUE_LABEL_MAX];
};

const char *tissue_kind_name(enum tissue_kind kind); // "bone", "meniscus", ...
bool tissue_kind_from_name(const char *name, enum tissue_kind *out_kind);
const char *tissue_side_name(enum tissue_side side); // "none", "medial", "lateral"
bool tissue_side_from_name(const char *name, enum tissue_side *out_side);

uint32_t tissue_colour(enum tissue_kind kind);
void tissue_rgb(uint32_t colour, double out_rgb[3]);                  // 0 to 1
bool tissue_colour_from_text(const char *text, uint32_t *out_colour); // "#rrggbb"

// 1 to TISSUE_LABEL_MAX - 1 bytes of UTF-8 without control characters.
bool tissue_label_is_valid(const char *label);

// What the name alone says: "meniscus_medial", "acl", "skin"; of others the kind is OTHER.
struct case_tissue tissue_usual(const char *name);

// Gives it this kind, with the kind's colour. Only a meniscus has zones.
void tissue_set_kind(struct case_tissue *tissue, enum tissue_kind kind);
