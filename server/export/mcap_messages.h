// The messages of a recording, as protobuf. Millimetres in, metres in the bytes.
#pragma once

#include "base/marker.h"
#include "mesh/mesh.h"
#include "step/output.h"

struct message { // reused from one to the next
    uint8_t *data;
    size_t size, room;
};

void message_fini(struct message *message);

// All that a schema of MCAP needs: a FileDescriptorSet of all messages.
extern const uint8_t mcap_schemas[];
extern const size_t mcap_schemas_size;

// Times are in ns since 1970-01-01 UTC.
void message_transform(struct message *message, uint64_t time_ns, const char *parent,
                       const char *child, pose T_parent_child);
void message_joint(struct message *message, uint64_t time_ns, const struct session_output *output);
// measured_ns: or NULL. nearest: the name of the nearest surface, or "".
void message_instrument(struct message *message, uint64_t time_ns, const uint64_t *measured_ns,
                        const char *nearest, const struct instrument_output *instrument);
// force: of kind SAMPLE_FORCE.
void message_force(struct message *message, uint64_t time_ns, uint64_t measured_ns,
                   const struct sample *force);
// name: in the case, or "".
void message_loose(struct message *message, uint64_t time_ns, const char *name,
                   const struct loose_output *loose);
void message_resection(struct message *message, uint64_t time_ns, const struct landed *landed);
void message_marker(struct message *message, uint64_t time_ns, const struct marker *marker);
void message_log(struct message *message, uint64_t time_ns, bool is_warning, const char *text,
                 const char *name);
// A mesh that follows the frame, in place of the one with this id.
void message_mesh(struct message *message, uint64_t time_ns, const char *frame, const char *id,
                  const struct mesh *mesh, const float rgba[4]);
void message_no_mesh(struct message *message, uint64_t time_ns, const char *id);
