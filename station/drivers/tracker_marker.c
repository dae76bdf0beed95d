#include "drivers/tracker_marker.h"

#include "base/number.h"
#include "drivers/options.h"

#include <float.h>
#include <string.h>

static const char word[] = "string ";

static enum result add_marker(struct tracker_markers *m, const struct device_config *config,
                              const struct device_option *option, struct error *err) {
    struct tracker_marker *marker = &m->all[m->count];
    const char *device = option->value + strlen(word);
    if (m->count == EDGES_MAX)
        return option_fail(config, option->key, err, RESULT_LIMIT,
                           "a device has at most %d markers", EDGES_MAX);
    enum result result = edge_init(&marker->edge, config, option->key, err);
    if (result != RESULT_OK)
        return result;
    if (strncmp(option->value, word, strlen(word)) != 0 || !*device ||
        strlen(device) >= sizeof marker->device)
        return option_fail(config, option->key, err, RESULT_INVALID,
                           "\"%s\" is not string DEVICE, a name of 1 to %d bytes", option->value,
                           IGTL_DEVICE_SIZE - 1);
    strcpy(marker->device, device);
    m->count++;
    return edge_check(&marker->edge, config, option->key, err);
}

enum result tracker_markers_configure(const struct device_config *config,
                                      struct tracker_markers *out, struct error *err) {
    *out = (struct tracker_markers){0};
    for (int i = 0; i < config->option_count; i++) {
        enum result result = edge_key(&config->options[i])
                                 ? add_marker(out, config, &config->options[i], err)
                                 : RESULT_OK;
        if (result != RESULT_OK)
            return result;
    }
    return RESULT_OK;
}

void tracker_markers_begin(struct tracker_markers *m) {
    m->clock = (struct stamp_clock){0};
}

static int64_t time_of(struct tracker_markers *m, bool uses_stamps,
                       const struct igtl_message *message, int64_t arrival_ns) {
    bool good = uses_stamps && message->stamp_ns &&
                stamp_judge(&m->clock, message->stamp_ns, arrival_ns) == STAMP_GOOD;
    return good ? stamp_time(&m->clock, message->stamp_ns, arrival_ns) : arrival_ns;
}

bool tracker_markers_take(struct tracker_markers *m, bool uses_stamps,
                          const struct igtl_message *message, int64_t arrival_ns,
                          struct device_reading *reading) {
    bool is_ours = false;
    int64_t time_ns = 0;
    double value = 1;
    for (int i = 0; i < m->count; i++) {
        if (strcmp(message->device, m->all[i].device) != 0)
            continue;
        if (!is_ours)
            time_ns = time_of(m, uses_stamps, message, arrival_ns);
        is_ours = true;
        number_double(message->text, -DBL_MAX, DBL_MAX, &value);
        reading_add_marker(reading, m->all[i].edge.name, time_ns, value);
    }
    return is_ours;
}
