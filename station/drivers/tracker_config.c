#include "drivers/tracker_config.h"

#include "drivers/options.h"

#include <string.h>

enum result tracker_configure_request(struct igtl_request *request,
                                      const struct device_config *config, struct error *err) {
    const char *kind = option_text(config, "request");
    const char *coordinates = option_text(config, "coordinates");
    const char *device = option_text(config, "device");
    const char *names[IGTL_REQUEST_KIND_COUNT + 1] = {NULL};
    int at = 0;
    for (int i = 0; i < IGTL_REQUEST_KIND_COUNT; i++)
        names[i] = igtl_request_name((enum igtl_request_kind)i);
    while (kind && at < IGTL_REQUEST_KIND_COUNT && strcmp(kind, names[at]))
        at++;
    if (at == IGTL_REQUEST_KIND_COUNT)
        return option_fail_name(config, "request", err, "unknown kind of request", kind, names);
    request->kind = (enum igtl_request_kind)at;
    if (coordinates && strlen(coordinates) >= sizeof request->coordinates)
        return option_fail(config, "coordinates", err, RESULT_LIMIT, "a name has at most %zu bytes",
                           sizeof request->coordinates - 1);
    strcpy(request->coordinates, coordinates ? coordinates : "");
    if (device && strlen(device) >= sizeof request->device)
        return option_fail(config, "device", err, RESULT_LIMIT, "a name has at most %zu bytes",
                           sizeof request->device - 1);
    strcpy(request->device, device ? device : "");
    return option_integer(config, "request_ms", 0, 1000, 5, &request->interval_ms, err);
}

enum result tracker_configure_unit(double *out_unit_mm, const struct device_config *config,
                                   struct error *err) {
    const char *unit = option_text(config, "unit");
    *out_unit_mm = unit && !strcmp(unit, "m") ? 1000 : 1;
    if (unit && strcmp(unit, "m") && strcmp(unit, "mm"))
        return option_fail(config, "unit", err, RESULT_INVALID, "is mm or m");
    return RESULT_OK;
}
