// The inside of a report, for main.c and report.c.
#pragma once

#include "bench.h"

struct report *report_create(const char *bench);
void report_destroy(struct report **report);
bool report_holds(const struct report *report); // every mark
void report_print_json(const struct report *report);
void report_print_table(const struct report *report);
