#include "quality/plan.h"

#include "base/check.h"

#include <stdlib.h>

struct marking {
    struct quality_plan *plan;
    enum sample_flag flag;
};

static void mark(void *context, int column, uint32_t first, uint32_t end) {
    const struct marking *m = context;
    (void)column;
    for (uint32_t i = first; i < end; i++)
        m->plan->samples[i] |= (uint8_t)m->flag;
}

static void mark_mesh(struct quality_plan *plan, const struct mesh *mesh, enum sample_flag flag) {
    int8_t *windings = alloc(plan->lattice.sample_count, sizeof *windings);
    lattice_in_mesh(&plan->lattice, mesh, windings, mark, &(struct marking){plan, flag});
    free(windings);
}

static void mark_region(struct quality_plan *plan, const struct convex *parts, int count,
                        enum sample_flag flag) {
    for (int i = 0; i < count; i++)
        lattice_in_convex(&plan->lattice, &parts[i], mark, &(struct marking){plan, flag});
}

static void count_samples(struct quality_plan *plan, bool may_go) {
    for (int column = 0; column < lattice_column_count(&plan->lattice); column++) {
        const struct lattice_column *c = &plan->lattice.columns[column];
        uint8_t zone = plan->zone_of[column];
        for (uint32_t i = c->first; i < c->first + (uint32_t)c->count; i++) {
            uint8_t flags = plan->samples[i];
            if (!(flags & SAMPLE_TISSUE))
                continue;
            plan->tissue[column]++;
            plan->whole[zone]++;
            plan->budget[zone] += may_go && !(flags & SAMPLE_KEPT);
            plan->planned += (flags & SAMPLE_PLANNED) != 0;
            plan->damaged += (flags & SAMPLE_DAMAGED) != 0;
        }
    }
}

static void find_zones(struct quality_plan *plan) {
    for (int column = 0; column < lattice_column_count(&plan->lattice); column++) {
        vec3 p = lattice_column_place(&plan->lattice, column);
        struct zone_place place = zones_place(&plan->zones, p.x, p.y);
        plan->zone_of[column] =
            (uint8_t)(ZONE_ACROSS_COUNT * zones_third(place.along) + zones_third(place.across));
    }
}

struct quality_plan *quality_plan_create(const struct quality_setting *setting) {
    struct quality_plan *plan = alloc(1, sizeof *plan);
    zones_of(setting->tissue, setting->up, setting->anterior, &plan->zones);
    lattice_init(&plan->lattice, &plan->zones.view, setting->tissue);
    size_t columns = (size_t)lattice_column_count(&plan->lattice);
    plan->samples = alloc(plan->lattice.sample_count, sizeof *plan->samples);
    plan->zone_of = alloc(columns, sizeof *plan->zone_of);
    plan->tissue = alloc(columns, sizeof *plan->tissue);
    mark_mesh(plan, setting->tissue, SAMPLE_TISSUE);
    if (setting->least)
        mark_mesh(plan, setting->least, SAMPLE_KEPT);
    mark_region(plan, setting->plan, setting->plan_count, SAMPLE_PLANNED);
    mark_region(plan, setting->damage, setting->damage_count, SAMPLE_DAMAGED);
    find_zones(plan);
    count_samples(plan, setting->least != NULL);
    contour_init(&plan->contour, &plan->zones, &plan->lattice, plan->tissue);
    return plan;
}

void quality_plan_destroy(struct quality_plan **plan) {
    if (*plan) {
        lattice_fini(&(*plan)->lattice);
        contour_fini(&(*plan)->contour);
        free((*plan)->samples);
        free((*plan)->zone_of);
        free((*plan)->tissue);
        free(*plan);
    }
    *plan = NULL;
}

void quality_zone(const struct quality_plan *plan, vec3 p, enum zone_along *out_along,
                  enum zone_across *out_across) {
    vec3 in_view = view_point(&plan->zones.view, p);
    struct zone_place place = zones_place(&plan->zones, in_view.x, in_view.y);
    *out_along = (enum zone_along)zones_third(place.along);
    *out_across = (enum zone_across)zones_third(place.across);
}
