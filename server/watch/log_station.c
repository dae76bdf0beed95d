#include "watch/log_station.h"

#include <string.h>

const char *log_station(const char *text, size_t *out_size) {
    static const char station[] = "station ";
    if (strncmp(text, station, sizeof station - 1) != 0)
        return NULL;
    const char *name = text + sizeof station - 1;
    *out_size = strcspn(name, ": ");
    return name;
}
