#include "drivers/edges.h"

#include "base/clock.h"
#include "drivers/options.h"

#include <stdio.h>
#include <string.h>

#define BOUNCE_NS (5 * NS_PER_MS)

static const char marker_prefix[] = "marker.";

const char *edge_key(const struct device_option *option) {
    return strncmp(option->key, marker_prefix, strlen(marker_prefix)) ? NULL : option->value;
}

enum result edge_init(struct edge *edge, const struct device_config *config, const char *key,
                      struct error *err) {
    struct marker example = {.number = 1};
    const char *name = key + strlen(marker_prefix);
    *edge = (struct edge){0};
    if (!marker_name_is_valid(name))
        return option_fail(config, key, err, RESULT_INVALID,
                           "a marker's name has 1 to %d letters, digits, -, _ and dots",
                           MARKER_TEXT_MAX - 1);
    snprintf(edge->name, sizeof edge->name, "%s", name);
    snprintf(example.name, sizeof example.name, "%s", name);
    snprintf(example.device, sizeof example.device, "%s", config->name);
    if (!marker_is_valid(&example))
        return option_fail(config, key, err, RESULT_INVALID,
                           "a device with markers has a name without control characters");
    return RESULT_OK;
}

bool edge_take_both(char *text) {
    size_t length = strlen(text), word = strlen(" both");
    bool both = length > word && !strcmp(text + length - word, " both");
    if (both)
        text[length - word] = '\0';
    return both;
}

enum result edge_check(const struct edge *edge, const struct device_config *config, const char *key,
                       struct error *err) {
    if (edge->each || strcmp(edge->name, MARKER_DONE) != 0)
        return RESULT_OK;
    return option_fail(config, key, err, RESULT_INVALID,
                       "a pedal that is held is a bit, coil or input with \"both\"");
}

void edge_begin(struct edge *edge) {
    edge->known = false;
}

void reading_add_marker(struct device_reading *reading, const char *name, int64_t time_ns,
                        double value) {
    if (reading->marker_count == DEVICE_MARKERS_MAX)
        reading->markers_lost++;
    else
        reading->markers[reading->marker_count++] = (struct device_marker){name, time_ns, value};
}

void edge_see(struct edge *edge, double value, int64_t time_ns, struct device_reading *reading) {
    bool was_known = edge->known, changed = edge->value != value;
    if (!isfinite(value) || (was_known && changed && time_ns - edge->last_ns < BOUNCE_NS))
        return;
    edge->known = true;
    edge->value = value;
    if (!was_known || !changed)
        return;
    edge->last_ns = time_ns;
    if (!edge->each && value == 0)
        return;
    reading_add_marker(reading, edge->name, time_ns, value);
}
