// How what a figure is about is called: the same words wherever figures go.
#pragma once

#include "metrics/metrics.h"

#define SUBJECT_MAX 64

// The group's name, or "group-3" where the case is not known (NULL) or has none such.
void subject_group(const struct knee_case *knee, int group, char out[SUBJECT_MAX]);
// The name of the tissue's group, or "tissue-0".
void subject_tissue(const struct knee_case *knee, int tissue, char out[SUBJECT_MAX]);
void subject_zone(const struct metric_value *value, char out[SUBJECT_MAX]); // "body.inner"
const char *subject_instrument(const struct metric_value *value);           // "probe"

// All of it: "probe", "probe femur from 0.5 mm", "meniscus_medial body.inner"; empty for the
// session. Long names of groups are cut.
void subject_text(const struct knee_case *knee, const struct metric_value *value,
                  char out[SUBJECT_MAX]);
