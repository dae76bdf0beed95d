// Figures as text for monitors: OpenMetrics 1.0, or the text format 0.0.4 of Prometheus. Names have
// base units, as arthron_step_seconds, and those of counters lack "_total", which is added.
#pragma once

#include "base/latency.h"

#include <stdbool.h>
#include <stdio.h>

enum figure_type { FIGURE_GAUGE, FIGURE_COUNTER, FIGURE_HISTOGRAM, FIGURE_INFO };

struct exposition {
    FILE *file;
    bool openmetrics;
    const char *name; // of the family that was begun last
    enum figure_type type;
};

// Begins a family; its values follow at once. unit: the end of the name, or NULL. help: one line.
void exposition_begin(struct exposition *e, const char *name, enum figure_type type,
                      const char *unit, const char *help);

// One of its values. label: NULL without one.
void exposition_value(struct exposition *e, const char *label, const char *label_value,
                      double value);
void exposition_latency(struct exposition *e, const struct latency_figures *figures);

// A family of one value without labels.
void exposition_one(struct exposition *e, const char *name, enum figure_type type, const char *unit,
                    const char *help, double value);

void exposition_end(struct exposition *e);
