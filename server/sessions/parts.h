// struct sessions. Private to this room.
#pragma once

#include "net/console.h"
#include "net/signer.h"
#include "records/claim.h"
#include "records/recorder.h"
#include "runtime/runtime.h"
#include "sessions/grades.h"
#include "sessions/station_slot.h"
#include "task/library.h"

#include <stdatomic.h>

struct manager;
struct own_traces;
struct resumed;
struct sharing;

struct sessions {
    struct sessions_config config;
    const atomic_bool *cancelled; // the caller's: ends a start early
    atomic_bool ending;           // sessions_break_off was called
    struct scene *scenes[SESSIONS_CASES_MAX];
    struct grades *grades;
    struct task_library *tasks;
    struct site_pool *sites;
    struct station_slot *slots;     // by station
    int *station_of;                // a peer's last; the control thread's
    struct runtime_station *served; // what the runtime knows of the stations
    struct runtime *runtime;
    struct control *control;
    struct console *console;
    struct signer *signer;
    struct trace_signer trace_signer; // with it
    struct claim *claim;              // of the records and the traces
    struct recorder *recorder;        // NULL: no records
    struct retention *retention;      // NULL: sessions are kept for good
    struct own_traces *own;           // NULL: all are
    struct manager *manager;
    struct sharing *sharing;   // NULL: this server is alone
    struct task_pool *closing; // of traces that no session goes on with
    struct resumed *resumed;   // while the server starts
    atomic_uint_fast64_t serials;
};

static inline bool sessions_are_ending(const struct sessions *sessions) {
    return atomic_load(&sessions->ending) || atomic_load(sessions->cancelled);
}

static inline const char *station_name(const struct sessions *sessions, int station) {
    return sessions->config.stations[station].name;
}
