#include "sessions/config.h"

#include <string.h>
#include <unistd.h>

int sessions_worker_count(const struct sessions_config *config) {
    return config->workers ? config->workers : (int)sysconf(_SC_NPROCESSORS_ONLN);
}

int sessions_find_case(const struct sessions_config *config, const char *name) {
    for (int i = 0; i < config->case_count; i++)
        if (!strcmp(config->cases[i].name, name))
            return i;
    return -1;
}

int sessions_find_station(const struct sessions_config *config, const char *name) {
    for (int i = 0; i < config->station_count; i++)
        if (!strcmp(config->stations[i].name, name))
            return i;
    return -1;
}
