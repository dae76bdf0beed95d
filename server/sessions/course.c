#include "sessions/course.h"

#include "base/clock.h"
#include "runtime/reply.h"
#include "sessions/opening.h"

#define INPUT_WAIT_NS (5 * NS_PER_S)
#define OPEN_WAIT_NS (30 * NS_PER_S)

bool course_input(struct sessions *s, int station, enum input_kind kind,
                  enum session_state expected, arthron_CommandReply *reply) {
    struct station_slot *slot = &s->slots[station];
    struct station_status status;
    bool done;
    uint64_t ticket = station_slot_new_ticket(slot);
    if (!runtime_input(s->runtime, station, kind, ticket) ||
        !station_slot_wait_taken(slot, ticket, clock_now_ns() + INPUT_WAIT_NS, &done))
        return reply_refuse_as(reply, arthron_Why_Code_BUSY, station_name(s, station),
                               "station %s: its worker is too busy", station_name(s, station));
    station_slot_status(slot, &status);
    if (!done || status.state != expected)
        return reply_refuse_as(reply, arthron_Why_Code_UNCHANGED, station_name(s, station),
                               "station %s: the session stayed as it was",
                               station_name(s, station));
    return reply->ok = true;
}

// The session manager may be faster: then its session is waited for.
bool course_open(struct sessions *s, int station, arthron_CommandReply *reply) {
    struct station_slot *slot = &s->slots[station];
    struct station_status status;
    struct error err;
    int64_t until_ns = clock_now_ns() + OPEN_WAIT_NS;
    do {
        bool waited = station_slot_wait_open(slot, until_ns);
        station_slot_status(slot, &status);
        if (status.phase == SLOT_ATTACHED)
            return true;
        if (!status.connected)
            return reply_refuse_as(reply, arthron_Why_Code_NOT_CONNECTED, station_name(s, station),
                                   "station %s is not connected", station_name(s, station));
        if (!waited)
            return reply_refuse_as(reply, arthron_Why_Code_BEING_OPENED, station_name(s, station),
                                   "station %s: its session is being opened or ended",
                                   station_name(s, station));
    } while (!station_slot_claim(slot, NULL));
    if (opening_run(s, station, &err) != RESULT_OK)
        return reply_refuse(reply, "%s", err.text);
    return true;
}

bool course_stop(struct sessions *s, int station, arthron_CommandReply *reply) {
    struct station_slot *slot = &s->slots[station];
    struct station_status status;
    station_slot_set_stopped(slot, true);
    station_slot_wait_open(slot, clock_now_ns() + OPEN_WAIT_NS);
    station_slot_status(slot, &status);
    if (status.phase == SLOT_EMPTY)
        return reply->ok = true;
    station_slot_ending(slot);
    if (!course_input(s, station, INPUT_STOP, SESSION_CLOSED, reply)) {
        if (station_slot_goes_on(slot))
            return false;
        reply->text[0] = '\0';
        reply->has_why = false;
    }
    station_slot_wait_ended(slot, status.about.serial, clock_now_ns() + INPUT_WAIT_NS);
    return reply->ok = true;
}
