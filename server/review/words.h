// What figures are called where people read them, as on the pages (web/src/text.ts).
#pragma once

#include "metrics/metrics.h"

const char *review_metric_words(enum metric metric);
