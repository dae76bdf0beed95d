// What a session's output and a job's outcome say to its station.
#pragma once

#include "session/session.h"
#include "wire/wire.h"

// bodies and instruments as in the output; the pose, displacement and gradient of each instrument
// go into the frame of the body whose surface is nearest, so that a moving bone does not make them
// old.
void reply_from_output(const struct session_output *output, const struct knee_case *knee,
                       uint64_t frame_number, int64_t frame_time_ns, arthron_Reply *out_reply);

// mesh_hash: of the mesh as stations follow it.
void reply_resection(const struct tissue_figures *figures, const char *group, uint64_t mesh_hash,
                     arthron_Resection *out_resection);
