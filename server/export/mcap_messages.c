#include "export/mcap_messages.h"

#include "base/check.h"
#include "base/clock.h"
#include "foxglove.pb.h"
#include "session.pb.h"

#include <pb_encode.h>
#include <stdlib.h>

#define M_PER_MM 1e-3

void message_fini(struct message *message) {
    free(message->data);
    *message = (struct message){0};
}

static void encode_message(struct message *message, const pb_msgdesc_t *fields, const void *value) {
    size_t size = 0;
    CHECK(pb_get_encoded_size(&size, fields, value));
    if (size > message->room) {
        message->data = alloc_resize(message->data, size, 1);
        message->room = size;
    }
    pb_ostream_t stream = pb_ostream_from_buffer(message->data, size);
    CHECK(pb_encode(&stream, fields, value));
    message->size = size;
}

// nanopb takes texts as char *, and only reads them.
static char *text_of(const char *text) {
    return (char *)text;
}

static google_protobuf_Timestamp stamp_of(uint64_t time_ns) {
    return (google_protobuf_Timestamp){(int64_t)(time_ns / NS_PER_S),
                                       (int32_t)(time_ns % NS_PER_S)};
}

static foxglove_Vector3 metres(vec3 mm) {
    return (foxglove_Vector3){M_PER_MM * mm.x, M_PER_MM * mm.y, M_PER_MM * mm.z};
}

void message_transform(struct message *message, uint64_t time_ns, const char *parent,
                       const char *child, pose p) {
    foxglove_FrameTransform m = {true,
                                 stamp_of(time_ns),
                                 text_of(parent),
                                 text_of(child),
                                 true,
                                 metres(p.translation),
                                 true,
                                 {p.rotation.x, p.rotation.y, p.rotation.z, p.rotation.w}};
    encode_message(message, foxglove_FrameTransform_fields, &m);
}

void message_joint(struct message *message, uint64_t time_ns, const struct session_output *output) {
    const struct joint_angles *joint = &output->joint;
    arthron_session_Joint m = {true,
                               stamp_of(time_ns),
                               text_of(validity_name(output->joint_validity)),
                               joint->flexion_deg,
                               joint->varus_deg,
                               joint->internal_deg,
                               M_PER_MM * joint->shift_mm,
                               M_PER_MM * joint->drawer_mm,
                               M_PER_MM * joint->distraction_mm};
    encode_message(message, arthron_session_Joint_fields, &m);
}

void message_instrument(struct message *message, uint64_t time_ns, const uint64_t *measured_ns,
                        const char *nearest, const struct instrument_output *o) {
    arthron_session_Instrument m = {true,
                                    stamp_of(time_ns),
                                    measured_ns != NULL,
                                    stamp_of(measured_ns ? *measured_ns : 0),
                                    text_of(validity_name(o->validity)),
                                    text_of(nearest),
                                    M_PER_MM * o->warp.nearest_mm,
                                    M_PER_MM * o->penetration_mm,
                                    M_PER_MM * o->discrepancy.offset_mm,
                                    o->discrepancy.tilt_deg,
                                    o->discrepancy.turn_deg,
                                    o->discrepancy.gain,
                                    o->discrepancy.gain_least,
                                    o->handle.opening,
                                    o->handle.buttons};
    encode_message(message, arthron_session_Instrument_fields, &m);
}

void message_force(struct message *message, uint64_t time_ns, uint64_t measured_ns,
                   const struct sample *force) {
    bool is_known = force->validity != VALIDITY_LOST;
    arthron_session_Force m = {true,
                               stamp_of(time_ns),
                               true,
                               stamp_of(measured_ns),
                               text_of(validity_name(force->validity)),
                               is_known,
                               is_known ? force->force_n : 0};
    encode_message(message, arthron_session_Force_fields, &m);
}

void message_loose(struct message *message, uint64_t time_ns, const char *name,
                   const struct loose_output *loose) {
    arthron_session_Loose m = {true, stamp_of(time_ns), text_of(name),
                               text_of(loose_state_name(loose->state)),
                               text_of(output_carrier_name(loose->carrier))};
    encode_message(message, arthron_session_Loose_fields, &m);
}

void message_resection(struct message *message, uint64_t time_ns, const struct landed *landed) {
    const struct tissue_figures *f = &landed->figures;
    arthron_session_Resection m = {true,
                                   stamp_of(time_ns),
                                   text_of(job_outcome_name(landed->outcome)),
                                   f->cuts,
                                   f->refused,
                                   f->pieces,
                                   f->volume_mm3,
                                   f->quality.removed_mm3,
                                   f->quality.planned_mm3,
                                   f->quality.over_mm3,
                                   f->quality.under_mm3,
                                   f->quality.damage_mm3,
                                   f->quality.rim_mm,
                                   f->quality.step_mm,
                                   f->touched_unseen_mm3,
                                   f->seen_untouched_mm3};
    encode_message(message, arthron_session_Resection_fields, &m);
}

void message_marker(struct message *message, uint64_t time_ns, const struct marker *marker) {
    arthron_session_Marker m = {
        true,          stamp_of(time_ns), text_of(marker->name), text_of(marker->device),
        marker->value, marker->number};
    encode_message(message, arthron_session_Marker_fields, &m);
}

void message_log(struct message *message, uint64_t time_ns, bool is_warning, const char *text,
                 const char *name) {
    foxglove_Log m = {true, stamp_of(time_ns),
                      is_warning ? foxglove_Log_Level_WARNING : foxglove_Log_Level_INFO,
                      text_of(text), text_of(name)};
    encode_message(message, foxglove_Log_fields, &m);
}

// ---- meshes -------------------------------------------------------------------------------------

static bool encode_points(pb_ostream_t *stream, const pb_field_t *field, void *const *arg) {
    const struct mesh *mesh = *arg;
    for (uint32_t i = 0; i < mesh->vertex_count; i++) {
        foxglove_Vector3 at = metres(mesh_vertex(mesh, i));
        foxglove_Point3 point = {at.x, at.y, at.z};
        if (!pb_encode_tag_for_field(stream, field) ||
            !pb_encode_submessage(stream, foxglove_Point3_fields, &point))
            return false;
    }
    return true;
}

// Packed, as all numbers of proto3 are.
static bool encode_indices(pb_ostream_t *stream, const pb_field_t *field, void *const *arg) {
    const struct mesh *mesh = *arg;
    size_t count = 3 * (size_t)mesh->triangle_count;
    if (!pb_encode_tag(stream, PB_WT_STRING, field->tag) || !pb_encode_varint(stream, 4 * count))
        return false;
    for (size_t i = 0; i < count; i++)
        if (!pb_encode_fixed32(stream, &mesh->triangles[i]))
            return false;
    return true;
}

static foxglove_TriangleListPrimitive triangles_of(const struct mesh *mesh, const float rgba[4]) {
    void *arg = (void *)mesh; // only read
    return (foxglove_TriangleListPrimitive){
        .has_pose = true,
        .pose = {true, {0}, true, {.w = 1}},
        .points = {.funcs.encode = encode_points, .arg = arg},
        .has_color = true,
        .color = {(double)rgba[0], (double)rgba[1], (double)rgba[2], (double)rgba[3]},
        .indices = {.funcs.encode = encode_indices, .arg = arg}};
}

void message_mesh(struct message *message, uint64_t time_ns, const char *frame, const char *id,
                  const struct mesh *mesh, const float rgba[4]) {
    foxglove_SceneUpdate m = {.entities_count = 1};
    m.entities[0] = (foxglove_SceneEntity){.has_timestamp = true,
                                           .timestamp = stamp_of(time_ns),
                                           .frame_id = text_of(frame),
                                           .id = text_of(id),
                                           .frame_locked = true,
                                           .triangles_count = 1,
                                           .triangles = {triangles_of(mesh, rgba)}};
    encode_message(message, foxglove_SceneUpdate_fields, &m);
}

void message_no_mesh(struct message *message, uint64_t time_ns, const char *id) {
    foxglove_SceneUpdate m = {.deletions_count = 1};
    m.deletions[0] =
        (foxglove_SceneEntityDeletion){.has_timestamp = true,
                                       .timestamp = stamp_of(time_ns),
                                       .type = foxglove_SceneEntityDeletion_Type_MATCHING_ID,
                                       .id = text_of(id)};
    encode_message(message, foxglove_SceneUpdate_fields, &m);
}
