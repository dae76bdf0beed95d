#include "drivers/device.h"

#include "base/check.h"
#include "base/clock.h"
#include "drivers/drivers.h"

#include <string.h>
#include <time.h>

const struct device_driver *const device_drivers[] = {
    &modbus_driver, &hid_driver, &tracker_driver, &recorded_driver, &simulated_driver, NULL,
};

const struct device_driver *device_driver(const char *name) {
    for (int i = 0; device_drivers[i]; i++)
        if (!strcmp(device_drivers[i]->name, name))
            return device_drivers[i];
    return NULL;
}

bool wait_until(int64_t due_ns) {
    int64_t latest = clock_now_ns() + POLL_MAX_NS, wake = due_ns < latest ? due_ns : latest;
    struct timespec at = {wake / NS_PER_S, wake % NS_PER_S};
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, NULL);
    return wake == due_ns;
}

int64_t due_within(int64_t due_ns, int64_t most_ns) {
    int64_t latest_ns = clock_now_ns() + most_ns;
    return due_ns < latest_ns ? due_ns : latest_ns;
}

void outputs_add(struct device_outputs *outputs, enum channel channel, enum sample_kind kind) {
    for (int i = 0; i < outputs->count; i++)
        if (outputs->outputs[i].channel == channel && outputs->outputs[i].kind == kind)
            return;
    CHECK(outputs->count < DEVICE_SAMPLES_MAX);
    outputs->outputs[outputs->count++] = (struct device_output){channel, kind};
}

void reading_put(struct device_reading *reading, const struct sample *sample) {
    int at = 0;
    while (at < reading->count && (reading->samples[at].channel != sample->channel ||
                                   reading->samples[at].kind != sample->kind))
        at++;
    CHECK(at < DEVICE_SAMPLES_MAX);
    reading->count += at == reading->count;
    reading->samples[at] = *sample;
}
