// Embree's device. For this room only.
#pragma once

#include "base/result.h"

#include <embree3/rtcore.h>

// One for the process, never released: Embree keeps caches of threads that outlive any owner.
// RESULT_IO where Embree cannot start.
enum result embree_device(RTCDevice *out_device, struct error *err);
