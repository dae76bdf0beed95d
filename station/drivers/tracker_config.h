// Keys of a tracker's section (drivers/tracker.c).
#pragma once

#include "drivers/device.h"
#include "igtl/request.h"

// request, request_ms, coordinates, device
enum result tracker_configure_request(struct igtl_request *request,
                                      const struct device_config *config, struct error *err);

enum result tracker_configure_unit(double *out_unit_mm, const struct device_config *config,
                                   struct error *err);
