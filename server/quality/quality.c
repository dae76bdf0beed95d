#include "quality/quality.h"

#include "base/check.h"
#include "quality/plan.h"

#include <stdlib.h>
#include <string.h>

#define SAMPLE_MM3 (LATTICE_MM * LATTICE_MM * LATTICE_MM)

struct quality {
    const struct quality_plan *plan;
    bool *taken;      // of each sample
    int8_t *windings; // of each sample: all 0 but while a piece is taken
    uint16_t *left;   // samples of each column's tissue
    uint32_t removed[ZONE_COUNT], over, planned, damaged; // samples that were taken
};

struct quality *quality_create(const struct quality_plan *plan) {
    struct quality *quality = alloc(1, sizeof *quality);
    size_t samples = plan->lattice.sample_count;
    size_t columns = (size_t)lattice_column_count(&plan->lattice);
    quality->plan = plan;
    quality->taken = alloc(samples, sizeof *quality->taken);
    quality->windings = alloc(samples, sizeof *quality->windings);
    quality->left = alloc(columns, sizeof *quality->left);
    memcpy(quality->left, plan->tissue, columns * sizeof *quality->left);
    return quality;
}

struct quality *quality_copy(const struct quality *quality) {
    struct quality *copy = quality_create(quality->plan);
    const struct lattice *lattice = &quality->plan->lattice;
    size_t columns = (size_t)lattice_column_count(lattice);
    memcpy(copy->taken, quality->taken, lattice->sample_count * sizeof *copy->taken);
    memcpy(copy->left, quality->left, columns * sizeof *copy->left);
    memcpy(copy->removed, quality->removed, sizeof copy->removed);
    copy->over = quality->over;
    copy->planned = quality->planned;
    copy->damaged = quality->damaged;
    return copy;
}

void quality_destroy(struct quality **quality) {
    if (*quality) {
        free((*quality)->taken);
        free((*quality)->windings);
        free((*quality)->left);
        free(*quality);
    }
    *quality = NULL;
}

// ---- taking -------------------------------------------------------------------------------------

static void take(void *context, int column, uint32_t first, uint32_t end) {
    struct quality *quality = context;
    const uint8_t *samples = quality->plan->samples;
    for (uint32_t i = first; i < end; i++) {
        if (quality->taken[i] || !(samples[i] & SAMPLE_TISSUE))
            continue;
        bool planned = samples[i] & SAMPLE_PLANNED;
        quality->taken[i] = true;
        quality->left[column]--;
        quality->removed[quality->plan->zone_of[column]]++;
        quality->planned += planned;
        quality->over += !planned;
        quality->damaged += (samples[i] & SAMPLE_DAMAGED) != 0;
    }
}

void quality_take_parts(struct quality *quality, const struct convex *parts, int count) {
    for (int i = 0; i < count; i++)
        lattice_in_convex(&quality->plan->lattice, &parts[i], take, quality);
}

void quality_take_piece(struct quality *quality, const struct mesh *piece) {
    lattice_in_mesh(&quality->plan->lattice, piece, quality->windings, take, quality);
}

// ---- keeping ------------------------------------------------------------------------------------

static size_t bit_bytes(const struct quality *quality) {
    return ((size_t)quality->plan->lattice.sample_count + 7) / 8;
}

static void write_bits(const struct quality *quality, uint8_t *bits) {
    for (uint32_t i = 0; i < quality->plan->lattice.sample_count; i++)
        bits[i / 8] |= (uint8_t)(quality->taken[i] << i % 8);
}

// All else follows from what was taken.
static void take_bits(struct quality *quality, const uint8_t *bits) {
    const struct lattice *lattice = &quality->plan->lattice;
    for (int c = 0; c < lattice_column_count(lattice); c++) {
        const struct lattice_column *column = &lattice->columns[c];
        for (uint32_t i = column->first; i < column->first + (uint32_t)column->count; i++)
            if (bits[i / 8] >> i % 8 & 1)
                take(quality, c, i, i + 1);
    }
}

void quality_keep(struct quality *quality, struct kept *k) {
    uint8_t *bits = alloc(bit_bytes(quality), 1);
    if (!k->reads)
        write_bits(quality, bits);
    kept_bytes(k, bits, bit_bytes(quality));
    if (k->reads)
        take_bits(quality, bits);
    free(bits);
}

// ---- reporting ----------------------------------------------------------------------------------

static struct zone_volumes volumes_of(const uint32_t counts[ZONE_COUNT]) {
    struct zone_volumes volumes;
    for (int i = 0; i < ZONE_COUNT; i++)
        volumes.mm3[i / ZONE_ACROSS_COUNT][i % ZONE_ACROSS_COUNT] = SAMPLE_MM3 * counts[i];
    return volumes;
}

void quality_report(const struct quality *quality, struct quality_report *out_report) {
    const struct quality_plan *plan = quality->plan;
    *out_report = (struct quality_report){
        .removed_mm3 = SAMPLE_MM3 * (quality->planned + quality->over),
        .planned_mm3 = SAMPLE_MM3 * plan->planned,
        .over_mm3 = SAMPLE_MM3 * quality->over,
        .under_mm3 = SAMPLE_MM3 * (plan->planned - quality->planned),
        .damage_mm3 = SAMPLE_MM3 * (plan->damaged - quality->damaged),
        .whole = volumes_of(plan->whole),
        .removed = volumes_of(quality->removed),
        .budget = volumes_of(plan->budget),
    };
    contour_measure(&plan->contour, plan->tissue, quality->left, &out_report->rim_mm,
                    &out_report->step_mm);
}
