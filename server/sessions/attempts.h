// Attempts at tasks: the commands BEGIN and LEAVE, those of a session that goes on, and what
// becomes of one that has ended. These functions make and release sites and read the records, so
// they hold no lock but the command lock of their station.
#pragma once

#include "sessions/parts.h"

// The caller holds the slot's command lock. False: the reply says why not.
bool attempts_begin_command(struct sessions *sessions, int station, const arthron_Command *command,
                            arthron_CommandReply *reply);
bool attempts_leave_command(struct sessions *sessions, int station, const arthron_Command *command,
                            arthron_CommandReply *reply);
// Its trainee gives the session up: practice that runs is left by them, as far as its worker can.
void attempts_leave_own(struct sessions *sessions, int station);

// Whether one of an exam runs at the station.
bool attempts_exam_runs(struct sessions *sessions, int station);

// Before a command that changes one: keeps the reason in the records. False: the reply says why not.
bool attempts_intervene(struct sessions *sessions, int station, const char *reason,
                        arthron_CommandReply *reply);

// The attempt of a trace that is run again, before its first step. scene: index of the case. at_ns:
// the session's clock. RESULT_REFUSED: its task cannot be done here any more.
enum result attempts_restore(const struct sessions *sessions, int scene,
                             const struct trace_header *header, const struct trace_attempt *begun,
                             int64_t at_ns, struct session_attempt **out_attempt,
                             struct error *err);

// NOTICE_ATTEMPT: hands one that has ended to the records, and frees it.
void attempts_release(struct sessions *sessions, int station, struct session_attempt *attempt);
void attempts_free(struct session_attempt **attempt); // NULL inside is fine
