// Opens a session with its trace, and releases it after its end. These functions make and close
// files, so they hold no lock of another station.
#pragma once

#include "sessions/parts.h"

// A session for the runtime, and its row in the records.
struct open_session {
    struct session_runtime runtime; // first: the runtime gives back its address
    struct store_session row;
};

// The header of a session of this station that begins now. id: 16 bytes.
void opening_header(const struct sessions *sessions, int station, const uint8_t id[16], int scene,
                    double strength, const char *trainee, struct trace_header *out_header);
enum result opening_trace_path(const struct sessions *sessions, const struct trace_header *header,
                               char out_path[SESSIONS_PATH_MAX], struct error *err);

// Opens a session on the slot's case. The caller has claimed the slot. If this fails, the slot is
// empty again, and the station gets the reason.
enum result opening_run(struct sessions *sessions, int station, struct error *err);

// Fills in a session's description for the slot, with a new serial. scene: index of its case.
void opening_about(struct sessions *sessions, const struct trace_header *header, int scene,
                   const char *trace, struct session_about *out_about);

// Gives the session to the slot and to the worker. The caller has claimed the slot. The session may
// have ended when this returns. said: as in station_slot_attached.
void opening_hand_over(struct sessions *sessions, int station, const struct session_about *about,
                       struct session_runtime *session, struct remarks *said,
                       struct marker_list *marked);

// Gives a session with an open trace to the slot, the records, the log and the worker. The caller
// has claimed the slot.
void opening_attach(struct sessions *sessions, int station, struct open_session *session,
                    const struct trace_header *header, int scene, const char *trace);

// NOTICE_ENDED: closes the trace, unless the session is handed over, and releases the session.
void opening_release(struct sessions *sessions, int station, struct session_runtime *ended,
                     enum session_end end);
