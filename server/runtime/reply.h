// What a session, its outputs and a job's outcome say to its station.
#pragma once

#include "metrics/metrics.h"
#include "step/session.h"
#include "wire/wire.h"

// Each instrument's pose and lead go into the frame of the body whose surface is nearest, so that a
// moving bone does not make them old: of the mock-up's body as it was measured, since it is the
// hand that they take to the virtual world.
void reply_from_output(const struct session_output *output, const struct knee_case *knee,
                       uint64_t frame_number, int64_t frame_time_ns, arthron_Reply *out_reply);

// The station's session: its state, its case, and how that one's bones hang together.
void reply_session(enum session_state state, const struct knee_case *knee,
                   arthron_SessionChange *out_change);

// mesh_hash: of the mesh as stations follow it.
void reply_resection(const struct tissue_figures *figures, const char *group, uint64_t mesh_hash,
                     arthron_Resection *out_resection);

// What a session is worth so far, without the depths at which it never was; knee: for the names.
// What is more than the message holds is left out.
void reply_metrics(const struct metrics *metrics, const struct knee_case *knee,
                   arthron_Metrics *out_metrics);

// Why a command is not done; false.
bool reply_refuse(arthron_CommandReply *reply, const char *format, ...)
    __attribute__((format(printf, 2, 3)));
