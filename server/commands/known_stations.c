#include "commands/known_stations.h"

#include "base/log.h"

#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>

#define FILE_NAME "stations"

// A config that cannot be kept is no reason not to serve.
void known_stations_write(const struct sessions_config *config) {
    char path[PATH_MAX], draft[PATH_MAX];
    snprintf(path, sizeof path, "%s/" FILE_NAME, config->keys_dir);
    snprintf(draft, sizeof draft, "%s/" FILE_NAME ".new", config->keys_dir);
    FILE *file = fopen(draft, "we");
    for (int i = 0; file && i < config->station_count; i++)
        fprintf(file, "%s\n", config->stations[i].name);
    if (!file || fclose(file) || rename(draft, path))
        log_warning("server", "%s: %s", path, strerror(errno));
}

void known_stations_warn(const char *keys_dir, const char *station) {
    char path[PATH_MAX], line[STATION_NAME_MAX + 1];
    snprintf(path, sizeof path, "%s/" FILE_NAME, keys_dir);
    FILE *file = fopen(path, "re");
    if (!file)
        return; // no server has run yet
    bool known = false;
    while (!known && fgets(line, sizeof line, file)) {
        line[strcspn(line, "\n")] = '\0';
        known = !strcmp(line, station);
    }
    bool whole = !ferror(file);
    fclose(file);
    if (!known && whole)
        fprintf(stderr,
                "arthron-server keys: warning: the server's config had no [station %s] at its last "
                "start. Add it and restart the server, else it refuses the station.\n",
                station);
}
