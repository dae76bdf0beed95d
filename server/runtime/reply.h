// Messages to a station, made from its session, the outputs of steps and the outcomes of jobs.
#pragma once

#include "metrics/metrics.h"
#include "step/session.h"
#include "wire/wire.h"

// Each instrument's pose and extrapolation are in the frame of the body with the nearest surface,
// so they stay right while the bone moves. The frame is that of the measured body, not the virtual
// one, because they take the measured hand to the virtual world.
void reply_from_output(const struct session_output *output, const struct knee_case *knee,
                       uint64_t frame_number, int64_t frame_time_ns, arthron_Reply *out_reply);

// A loose body's carrier: a body, or an instrument's channel.
uint8_t reply_carrier(int carrier);

// The session's state, its case, and how the bones of the case are joined.
void reply_session(enum session_state state, const struct knee_case *knee,
                   arthron_SessionChange *out_change);

// What the case's groups and loose bodies are.
void reply_groups(const struct knee_case *knee, arthron_LiveSession *out_session);

// mesh_hash: of the mesh as stations follow it.
void reply_resection(const struct tissue_figures *figures, const char *group, uint64_t mesh_hash,
                     arthron_Resection *out_resection);

// The metrics so far, without depths that never occurred. knee: for the names. Figures for which
// the message has no room are left out.
void reply_metrics(const struct metrics *metrics, const struct knee_case *knee,
                   arthron_Metrics *out_metrics);

// A code and the one parameter that it has, or none (NULL), cut to its length.
void reply_why(arthron_Why_Code code, const char *parameter, arthron_Why *out);

// A second one.
void reply_why_also(const char *parameter, arthron_Why *why);

// Sets the reason why a command is refused. Returns false.
bool reply_refuse(arthron_CommandReply *reply, const char *format, ...)
    __attribute__((format(printf, 2, 3)));

// The same with a code for programs, and its parameter or NULL.
bool reply_refuse_as(arthron_CommandReply *reply, arthron_Why_Code code, const char *parameter,
                     const char *format, ...) __attribute__((format(printf, 4, 5)));
