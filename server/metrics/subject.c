#include "metrics/subject.h"

#include <stdio.h>
#include <string.h>

_Static_assert(SUBJECT_MAX >= CASE_NAME_MAX && SUBJECT_LABEL_MAX >= SUBJECT_MAX,
               "a group's name fits");

void subject_group(const struct knee_case *knee, int group, char out[SUBJECT_MAX]) {
    if (knee && group < knee->group_count)
        snprintf(out, SUBJECT_MAX, "%s", knee->groups[group].name);
    else
        snprintf(out, SUBJECT_MAX, "group-%d", group);
}

// Tissues are the cuttable groups in the case's order.
static const struct case_group *group_of_tissue(const struct knee_case *knee, int tissue) {
    for (int g = 0; knee && g < knee->group_count; g++)
        if (knee->groups[g].cuttable && tissue-- == 0)
            return &knee->groups[g];
    return NULL;
}

void subject_tissue(const struct knee_case *knee, int tissue, char out[SUBJECT_MAX]) {
    const struct case_group *group = group_of_tissue(knee, tissue);
    if (group)
        snprintf(out, SUBJECT_MAX, "%s", group->name);
    else
        snprintf(out, SUBJECT_MAX, "tissue-%d", tissue);
}

void subject_zone(const struct metric_value *v, char out[SUBJECT_MAX]) {
    static const char *const along[ZONE_ALONG_COUNT] = {"anterior_horn", "body", "posterior_horn"};
    static const char *const across[ZONE_ACROSS_COUNT] = {"inner", "middle", "outer"};
    snprintf(out, SUBJECT_MAX, "%s.%s", along[v->along], across[v->across]);
}

// Owner, place and part of it; the latter two may be empty.
static void join(const struct metric_value *v, const char *place, char *out, size_t size) {
    char part[SUBJECT_MAX] = "";
    const char *owner = v->owner ? v->owner : "";
    if (v->depth >= 0)
        snprintf(part, sizeof part, "from %g mm", touch_depth_mm[v->depth]);
    if (v->along >= 0)
        subject_zone(v, part);
    snprintf(out, size, "%s%s%.30s%s%s", owner, *owner && *place ? " " : "", place,
             *part ? " " : "", part);
}

void subject_text(const struct knee_case *knee, const struct metric_value *v,
                  char out[SUBJECT_MAX]) {
    char place[SUBJECT_MAX] = "", whole[4 * SUBJECT_MAX];
    if (v->group >= 0)
        subject_group(knee, v->group, place);
    if (v->tissue >= 0)
        subject_tissue(knee, v->tissue, place);
    join(v, place, whole, sizeof whole);
    snprintf(out, SUBJECT_MAX, "%.63s", whole);
}

void subject_tissue_label(const struct knee_case *knee, int tissue, char out[SUBJECT_LABEL_MAX]) {
    const struct case_group *group = group_of_tissue(knee, tissue);
    if (group)
        snprintf(out, SUBJECT_LABEL_MAX, "%s", group->tissue.label);
    else
        subject_tissue(knee, tissue, out);
}

void subject_label(const struct knee_case *knee, const struct metric_value *v,
                   char out[SUBJECT_LABEL_MAX]) {
    char place[SUBJECT_LABEL_MAX] = "";
    if (v->group >= 0 && knee && v->group < knee->group_count)
        snprintf(place, sizeof place, "%s", knee->groups[v->group].tissue.label);
    else if (v->group >= 0)
        subject_group(knee, v->group, place);
    if (v->tissue >= 0)
        subject_tissue_label(knee, v->tissue, place);
    join(v, place, out, SUBJECT_LABEL_MAX);
}
