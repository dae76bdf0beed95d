// What the parts of `arthron-station probe` share: each looks at one kind of device, adds what it
// sees to a JSON array, and writes comments with live values and a proposed section to `config`.
#pragma once

#include "base/result.h"

#include <jansson.h>
#include <stdio.h>

// One line, TCP (HOST:PORT) or serial (a path): slaves 1 to `slaves`.
enum result probe_modbus(const char *line, int slaves, FILE *config, json_t *out,
                         struct error *err);

// Listens for `seconds`.
enum result probe_tracker(const char *address, double seconds, FILE *config, json_t *out,
                          struct error *err);

// All that is plugged in.
void probe_hid(FILE *config, json_t *out);
