#include "metrics/subject.h"

#include <stdio.h>
#include <string.h>

_Static_assert(SUBJECT_MAX >= CASE_NAME_MAX, "a group's name fits");

void subject_group(const struct knee_case *knee, int group, char out[SUBJECT_MAX]) {
    if (knee && group < knee->group_count)
        snprintf(out, SUBJECT_MAX, "%s", knee->groups[group].name);
    else
        snprintf(out, SUBJECT_MAX, "group-%d", group);
}

// Tissues are the cuttable groups in the case's order.
void subject_tissue(const struct knee_case *knee, int tissue, char out[SUBJECT_MAX]) {
    int count = 0;
    snprintf(out, SUBJECT_MAX, "tissue-%d", tissue);
    for (int g = 0; knee && g < knee->group_count; g++)
        if (knee->groups[g].cuttable && count++ == tissue)
            subject_group(knee, g, out);
}

void subject_zone(const struct metric_value *v, char out[SUBJECT_MAX]) {
    static const char *const along[ZONE_ALONG_COUNT] = {"anterior_horn", "body", "posterior_horn"};
    static const char *const across[ZONE_ACROSS_COUNT] = {"inner", "middle", "outer"};
    snprintf(out, SUBJECT_MAX, "%s.%s", along[v->along], across[v->across]);
}

const char *subject_instrument(const struct metric_value *v) {
    return v->tool;
}

void subject_text(const struct knee_case *knee, const struct metric_value *v,
                  char out[SUBJECT_MAX]) {
    char place[SUBJECT_MAX] = "", part[SUBJECT_MAX] = "", whole[4 * SUBJECT_MAX];
    const char *instrument = v->instrument >= 0 ? subject_instrument(v) : "";
    if (v->group >= 0)
        subject_group(knee, v->group, place);
    if (v->tissue >= 0)
        subject_tissue(knee, v->tissue, place);
    if (v->depth >= 0)
        snprintf(part, sizeof part, "from %g mm", touch_depth_mm[v->depth]);
    if (v->along >= 0)
        subject_zone(v, part);
    snprintf(whole, sizeof whole, "%s%s%.30s%s%s", instrument, *instrument && *place ? " " : "",
             place, *part ? " " : "", part);
    snprintf(out, SUBJECT_MAX, "%.63s", whole);
}
