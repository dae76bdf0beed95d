#include "watch/exposition.h"

#include <inttypes.h>

static const char *suffix(const struct exposition *e) {
    return e->type == FIGURE_COUNTER ? "_total" : e->type == FIGURE_INFO ? "_info" : "";
}

// The text format has no infos, and knows a counter by its whole name.
void exposition_begin(struct exposition *e, const char *name, enum figure_type type,
                      const char *unit, const char *help) {
    static const char *const types[] = {"gauge", "counter", "histogram", "info"};
    e->name = name;
    e->type = type;
    const char *shown = e->openmetrics ? "" : suffix(e);
    const char *shown_type = type == FIGURE_INFO && !e->openmetrics ? "gauge" : types[type];
    fprintf(e->file, "# HELP %s%s %s\n# TYPE %s%s %s\n", name, shown, help, name, shown,
            shown_type);
    if (unit && e->openmetrics)
        fprintf(e->file, "# UNIT %s %s\n", name, unit);
}

static void write_escaped(FILE *file, const char *text) {
    for (; *text; text++) {
        if (*text == '\\' || *text == '"')
            fputc('\\', file);
        if (*text == '\n')
            fputs("\\n", file);
        else
            fputc(*text, file);
    }
}

void exposition_value(struct exposition *e, const char *label, const char *label_value,
                      double value) {
    fprintf(e->file, "%s%s", e->name, suffix(e));
    if (label) {
        fprintf(e->file, "{%s=\"", label);
        write_escaped(e->file, label_value);
        fputs("\"}", e->file);
    }
    fprintf(e->file, " %.17g\n", value);
}

static void write_bound(FILE *file, int bucket) {
    if (bucket == LATENCY_BOUNDS)
        fputs("+Inf", file);
    else
        fprintf(file, "%g", (double)latency_bound_ns(bucket) / 1e9);
}

void exposition_latency(struct exposition *e, const struct latency_figures *figures) {
    uint64_t count = 0;
    for (int i = 0; i < LATENCY_BUCKETS; i++) {
        count += figures->counts[i];
        fprintf(e->file, "%s_bucket{le=\"", e->name);
        write_bound(e->file, i);
        fprintf(e->file, "\"} %" PRIu64 "\n", count);
    }
    fprintf(e->file, "%s_sum %.17g\n%s_count %" PRIu64 "\n", e->name, (double)figures->sum_ns / 1e9,
            e->name, count);
}

void exposition_one(struct exposition *e, const char *name, enum figure_type type, const char *unit,
                    const char *help, double value) {
    exposition_begin(e, name, type, unit, help);
    exposition_value(e, NULL, NULL, value);
}

void exposition_end(struct exposition *e) {
    if (e->openmetrics)
        fputs("# EOF\n", e->file);
}
