// What replay prints of the same hands under other settings.
#pragma once

#include "trace/trial.h"

void trial_print_json(const struct trial_report *report, double real_time);
void trial_print_text(const struct trial_report *report, double real_time);
