#include "handle_player.h"

#include "base/clock.h"
#include "base/log.h"
#include "handle.h"

#include <time.h>

static const double closed_opening = 0.05; // the end switch closes below it

enum result handle_player_plug(struct handle_player *p, struct error *err) {
    return handle_plug(p->serial, "", &p->handle, err);
}

static const struct fault *strike_handle(const struct handle_player *p, enum fault_what what,
                                         double due) {
    return faults_strike(p->faults, FAULT_HID, what, due);
}

static bool has_jaw(const struct recording_tool *tool) {
    return tool->has_opening &&
           (tool->channel == CHANNEL_PUNCH || tool->channel == CHANNEL_FIRST_DESCRIBED);
}

static double opening_at(const struct player *player, double seconds) {
    const struct recording *r = &player->recording;
    for (int i = 0; i < r->tool_count; i++)
        if (has_jaw(&r->tools[i]))
            return recording_tool_at(r, i, player_file_time(player, seconds)).opening;
    return 0;
}

static enum result send_report(const struct handle_player *p, double due, struct error *err) {
    uint8_t report[HANDLE_REPORT_BYTES];
    const struct fault *late = strike_handle(p, FAULT_LATE, due),
                       *jump = strike_handle(p, FAULT_JUMP, due),
                       *noise = strike_handle(p, FAULT_NOISE, due);
    double seconds = faults_time(p->faults, FAULT_HID, due) - (late ? late->value / 1000 : 0);
    double opening = opening_at(p->player, seconds);
    if (jump)
        opening += jump->value / 100;
    if (noise)
        opening += noise->value / 100 * faults_noise();
    unsigned buttons = (opening < closed_opening) | (unsigned)player_pulse(clock_now_ns()) << 1;
    handle_report(opening, (uint8_t)buttons, report);
    size_t size = faults_spoil(p->faults, FAULT_HID, due, report, sizeof report);
    return handle_send(p->handle, report, size, err);
}

// Pulls the plug and puts it back as the faults say.
static enum result keep_plugged(struct handle_player *p, double due, struct error *err) {
    bool unplugged = faults_on(p->faults, FAULT_HID, FAULT_UNPLUG, due);
    if (!unplugged && p->handle < 0)
        return handle_plug(p->serial, "", &p->handle, err);
    if (unplugged && p->handle >= 0) {
        handle_unplug(p->handle);
        p->handle = -1;
    }
    return RESULT_OK;
}

void *handle_player_run(void *handle_player) {
    struct handle_player *p = handle_player;
    int64_t due_ns = clock_now_ns();
    while (!atomic_load(p->stop)) {
        struct error err;
        double due = player_seconds(p->player, due_ns);
        enum result result = keep_plugged(p, due, &err);
        if (result == RESULT_OK && p->handle >= 0 && !strike_handle(p, FAULT_DROPOUT, due))
            result = send_report(p, due, &err);
        if (result != RESULT_OK)
            log_warning("hid", "%s", err.text);
        due_ns += result == RESULT_OK ? (int64_t)(NS_PER_S / p->rate_hz) : NS_PER_S;
        struct timespec at = {due_ns / NS_PER_S, due_ns % NS_PER_S};
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, NULL);
    }
    if (p->handle >= 0)
        handle_unplug(p->handle);
    p->handle = -1;
    return NULL;
}
