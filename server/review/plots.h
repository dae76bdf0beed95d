// The plots of a session's report, each a figure of a page.
#pragma once

#include "review/lines.h"

#include <stdio.h>

// Its path in two projections, the offset, the gain and the turn, with what may be noticed shaded.
void report_plot_tip(FILE *file, const struct tip_lines *tip);
void report_plot_force(FILE *file, const struct force_lines *force);
void report_plot_joint(FILE *file, const struct report_lines *lines);
void report_plot_volume(FILE *file, const char *title, const struct tissue_lines *tissue);
void report_plot_mismatch(FILE *file, const char *title, const struct tissue_lines *tissue);
