#include "case/tissue.h"

#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const struct {
    const char *name;
    uint32_t colour;
} kinds[TISSUE_KIND_COUNT] = {
    [TISSUE_OTHER] = {"other", 0xdbb3a3},         [TISSUE_BONE] = {"bone", 0xf0e3c4},
    [TISSUE_CARTILAGE] = {"cartilage", 0xd9e6e8}, [TISSUE_MENISCUS] = {"meniscus", 0xa8c4d6},
    [TISSUE_LIGAMENT] = {"ligament", 0xdbb3a3},   [TISSUE_SYNOVIUM] = {"synovium", 0xf0a69e},
    [TISSUE_SKIN] = {"skin", 0xdea88c},
};

static const char *const sides[TISSUE_SIDE_COUNT] = {"none", "medial", "lateral"};

const char *tissue_kind_name(enum tissue_kind kind) {
    return kinds[kind].name;
}

bool tissue_kind_from_name(const char *name, enum tissue_kind *out_kind) {
    for (int i = 0; i < TISSUE_KIND_COUNT; i++)
        if (!strcmp(kinds[i].name, name)) {
            *out_kind = (enum tissue_kind)i;
            return true;
        }
    return false;
}

const char *tissue_side_name(enum tissue_side side) {
    return sides[side];
}

bool tissue_side_from_name(const char *name, enum tissue_side *out_side) {
    for (int i = 0; i < TISSUE_SIDE_COUNT; i++)
        if (!strcmp(sides[i], name)) {
            *out_side = (enum tissue_side)i;
            return true;
        }
    return false;
}

uint32_t tissue_colour(enum tissue_kind kind) {
    return kinds[kind].colour;
}

void tissue_rgb(uint32_t colour, double out_rgb[3]) {
    for (int i = 0; i < 3; i++)
        out_rgb[i] = (double)(colour >> (16 - 8 * i) & 255) / 255;
}

bool tissue_colour_from_text(const char *text, uint32_t *out_colour) {
    if (strlen(text) != 7 || text[0] != '#' || strspn(text + 1, "0123456789abcdefABCDEF") != 6)
        return false;
    *out_colour = (uint32_t)strtoul(text + 1, NULL, 16);
    return true;
}

bool tissue_label_is_valid(const char *label) {
    size_t length = strlen(label);
    for (size_t i = 0; i < length; i++)
        if ((unsigned char)label[i] < ' ' || label[i] == 0x7f)
            return false;
    json_t *text = json_string(label); // NULL: it is not UTF-8
    json_decref(text);
    return text && length > 0 && length < TISSUE_LABEL_MAX;
}

// ---- by name ------------------------------------------------------------------------------------

static const struct known {
    const char *name, *label;
    enum tissue_kind kind;
    enum tissue_side side;
} known[] = {
    {"femur", "Femur", TISSUE_BONE, TISSUE_NO_SIDE},
    {"tibia", "Tibia", TISSUE_BONE, TISSUE_NO_SIDE},
    {"patella", "Patella", TISSUE_BONE, TISSUE_NO_SIDE},
    {"fibula", "Fibula", TISSUE_BONE, TISSUE_NO_SIDE},
    {"meniscus_medial", "Medial meniscus", TISSUE_MENISCUS, TISSUE_MEDIAL},
    {"meniscus_lateral", "Lateral meniscus", TISSUE_MENISCUS, TISSUE_LATERAL},
    {"acl", "Anterior cruciate ligament", TISSUE_LIGAMENT, TISSUE_NO_SIDE},
    {"pcl", "Posterior cruciate ligament", TISSUE_LIGAMENT, TISSUE_NO_SIDE},
    {"mcl", "Medial collateral ligament", TISSUE_LIGAMENT, TISSUE_MEDIAL},
    {"lcl", "Lateral collateral ligament", TISSUE_LIGAMENT, TISSUE_LATERAL},
    {"patellar_ligament", "Patellar ligament", TISSUE_LIGAMENT, TISSUE_NO_SIDE},
    {"patellar_tendon", "Patellar tendon", TISSUE_LIGAMENT, TISSUE_NO_SIDE},
    {"skin", "Skin", TISSUE_SKIN, TISSUE_NO_SIDE},
};

static void set_label(struct case_tissue *tissue, const char *name) {
    snprintf(tissue->label, sizeof tissue->label, "%s", name);
    for (char *c = tissue->label; *c; c++)
        if (*c == '_' || *c == '-')
            *c = ' ';
    if (tissue->label[0] >= 'a' && tissue->label[0] <= 'z')
        tissue->label[0] += 'A' - 'a';
}

static bool begins(const char *name, const char *with) {
    return !strncmp(name, with, strlen(with));
}

void tissue_set_kind(struct case_tissue *tissue, enum tissue_kind kind) {
    tissue->kind = kind;
    tissue->colour = kinds[kind].colour;
    tissue->has_zones = kind == TISSUE_MENISCUS;
}

struct case_tissue tissue_usual(const char *name) {
    struct case_tissue tissue = {0};
    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
        if (!strcmp(known[i].name, name)) {
            tissue_set_kind(&tissue, known[i].kind);
            tissue.side = known[i].side;
            set_label(&tissue, known[i].label);
            return tissue;
        }
    tissue_set_kind(&tissue, begins(name, "meniscus")    ? TISSUE_MENISCUS
                             : begins(name, "cartilage") ? TISSUE_CARTILAGE
                                                         : TISSUE_OTHER);
    tissue.has_zones = true; // as all that is cut has where nothing describes it
    set_label(&tissue, name);
    return tissue;
}
