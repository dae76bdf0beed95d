// A session is opened, with its trace, and released after its end. Files are made and closed here,
// so nothing of this holds a lock of other stations.
#pragma once

#include "sessions/parts.h"

// A session as the runtime has it, and its row in the records.
struct open_session {
    struct session_runtime runtime; // first: the runtime gives back its address
    struct store_session row;
};

// The header of a session of this station that begins now. id: 16 bytes.
void opening_header(const struct sessions *sessions, int station, const uint8_t id[16], int scene,
                    double strength, const char *trainee, struct trace_header *out_header);
enum result opening_trace_path(const struct sessions *sessions, const struct trace_header *header,
                               char out_path[SESSIONS_PATH_MAX], struct error *err);

// Opens a session on the slot's case. The caller has claimed the slot; where the opening fails, the
// slot is empty again and the station is told why.
enum result opening_run(struct sessions *sessions, int station, struct error *err);

// What the slot keeps of a session, with a serial of its own. scene: index of its case.
void opening_about(struct sessions *sessions, const struct trace_header *header, int scene,
                   const char *trace, struct session_about *out_about);

// The slot, which the caller has claimed, and the worker get the session at once; it may have ended
// when this returns. said: as station_slot_attached has it.
void opening_hand_over(struct sessions *sessions, int station, const struct session_about *about,
                       struct session_runtime *session, struct remarks *said);

// Session and trace are there: the slot, which the caller has claimed, the records and the log
// learn of it, and the worker gets it.
void opening_attach(struct sessions *sessions, int station, struct open_session *session,
                    const struct trace_header *header, int scene, const char *trace);

// NOTICE_ENDED: closes the trace, unless the session is handed over, and releases the session.
void opening_release(struct sessions *sessions, int station, struct session_runtime *ended,
                     enum session_end end);
