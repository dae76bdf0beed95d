#include "tools/findings.h"

#include <jansson.h>
#include <stdarg.h>
#include <stdio.h>

void findings_add(struct findings *findings, bool good, const char *what, const char *advice,
                  const char *format, ...) {
    findings->faults += !good;
    if (findings->count == FINDINGS_MAX)
        return;
    struct finding *finding = &findings->items[findings->count++];
    va_list args;
    va_start(args, format);
    vsnprintf(finding->text, sizeof finding->text, format, args);
    va_end(args);
    snprintf(finding->what, sizeof finding->what, "%s", what);
    finding->good = good;
    finding->advice = advice;
}

bool findings_are_good(const struct findings *findings) {
    return !findings->faults;
}

void findings_print(const struct findings *findings, const char *station) {
    for (int i = 0; i < findings->count; i++) {
        const struct finding *finding = &findings->items[i];
        printf("%-4s  %-20s %s\n", finding->good ? "ok" : "BAD", finding->what, finding->text);
        if (!finding->good)
            printf("      %-20s -> %s\n", "", finding->advice);
    }
    if (findings->faults)
        printf("%s: NOT READY, faults: %d\n", station, findings->faults);
    else
        printf("%s: ready\n", station);
}

void findings_print_json(const struct findings *findings, const char *station) {
    json_t *list = json_array();
    for (int i = 0; i < findings->count; i++) {
        const struct finding *f = &findings->items[i];
        json_t *item =
            json_pack("{s:s, s:b, s:s}", "what", f->what, "good", f->good, "text", f->text);
        json_object_set_new(item, "advice", f->good ? json_null() : json_string(f->advice));
        json_array_append_new(list, item);
    }
    json_t *whole = json_pack("{s:s, s:b, s:o}", "station", station, "ready",
                              findings_are_good(findings), "findings", list);
    json_dumpf(whole, stdout, JSON_COMPACT);
    putchar('\n');
    json_decref(whole);
}
