// How what a figure is about is called: the same words wherever figures go.
#pragma once

#include "metrics/metrics.h"

#define SUBJECT_MAX 64
#define SUBJECT_LABEL_MAX 160

// The group's name, or "group-3" where the case is not known (NULL) or has none such.
void subject_group(const struct knee_case *knee, int group, char out[SUBJECT_MAX]);
// The name of the tissue's group, or "tissue-0".
void subject_tissue(const struct knee_case *knee, int tissue, char out[SUBJECT_MAX]);
void subject_zone(const struct metric_value *value, char out[SUBJECT_MAX]); // "body.inner"

// All of it: "probe", "tibia", "probe femur from 0.5 mm", "meniscus_medial body.inner"; empty for
// the session. Long names of groups are cut.
void subject_text(const struct knee_case *knee, const struct metric_value *value,
                  char out[SUBJECT_MAX]);

// The same for people, with the labels of groups: "probe Femur from 0.5 mm", "Medial meniscus".
void subject_tissue_label(const struct knee_case *knee, int tissue, char out[SUBJECT_LABEL_MAX]);
void subject_label(const struct knee_case *knee, const struct metric_value *value,
                   char out[SUBJECT_LABEL_MAX]);
