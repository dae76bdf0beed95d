// arthron-bench: measures, and holds the figures against marks. A bench is a file with a run
// function, and a row in the table of main.c.
#pragma once

#include "base/result.h"

#include <stdbool.h>

struct bench_options {
    bool quick;                // under 40 s, with fewer samples
    const char *const *inputs; // folders or files: of --case, and the arguments after the name
    int input_count;
    const char *out; // a folder for what a bench writes; NULL: nothing
};

// What a bench found out, printed at the end.
struct report;

enum better { BETTER_LOW, BETTER_HIGH };

// A figure that must not be above (or below) its mark.
void report_mark(struct report *report, const char *name, double value, const char *unit,
                 double mark, enum better better);

// Any other figure. Names are paths: "20k/near/following". NaN and infinities become null.
void report_figure(struct report *report, double value, const char *unit, const char *name, ...)
    __attribute__((format(printf, 4, 5)));

// A fact in words.
void report_text(struct report *report, const char *name, const char *text);

// A bench that cannot measure returns an error; a mark that does not hold is none.
typedef enum result bench_run(const struct bench_options *options, struct report *report,
                              struct error *err);

bench_run bench_cluster, bench_cut, bench_devices, bench_fidelity, bench_match, bench_metrics,
    bench_paper, bench_resume, bench_server, bench_tasks, bench_trace, bench_warp;
