// The stations that the server's config names, kept beside its keys: who makes a code for another
// one is warned. For `keys enrol`, which reads no config.
#pragma once

#include "sessions/config.h"

void known_stations_write(const struct sessions_config *config);

// Prints a warning where the last start of the server did not know the station.
void known_stations_warn(const char *keys_dir, const char *station);
