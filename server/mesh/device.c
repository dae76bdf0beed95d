#include "mesh/device.h"

#include <pthread.h>

static RTCDevice device;
static pthread_once_t device_once = PTHREAD_ONCE_INIT;

static void make_device(void) {
    device = rtcNewDevice("threads=1");
}

enum result embree_device(RTCDevice *out_device, struct error *err) {
    pthread_once(&device_once, make_device);
    *out_device = device;
    if (device)
        return RESULT_OK;
    return fail(err, RESULT_IO, "Embree cannot start: error %d", rtcGetDeviceError(NULL));
}
