// What the parts of `arthron-station probe` share: each looks at one kind of device, adds what it
// sees to a JSON array, and writes comments with live values and a proposed section to `config`.
#pragma once

#include "base/result.h"
#include "drivers/hid_find.h"

#include <jansson.h>
#include <stdio.h>

// One line, TCP (HOST:PORT) or serial (a path): slaves 1 to `slaves`. Of a serial line the usual
// settings are tried until a slave answers.
enum result probe_modbus(const char *line, int slaves, FILE *config, json_t *out,
                         struct error *err);

// Listens for `seconds`.
enum result probe_tracker(const char *address, double seconds, FILE *config, json_t *out,
                          struct error *err);

// All that is plugged in. Of several that are alike the proposals say which is which: by serial
// number, or by port where they have none or the same.
void probe_hid(FILE *config, json_t *out);

// The part of it that needs no device. `read_descriptor` as hid_read_descriptor.
typedef enum result descriptor_reader(const char *path, uint8_t *out_bytes, size_t *out_size,
                                      struct error *err);
void probe_hid_plugged(const struct hid_plugged *plugged, int count,
                       descriptor_reader *read_descriptor, FILE *config, json_t *out);
