#include "igtl/stream.h"

#include "igtl/metadata.h"

#include <openigtlink/igtl_position.h>
#include <openigtlink/igtl_qtdata.h>
#include <openigtlink/igtl_tdata.h>
#include <openigtlink/igtl_transform.h>
#include <stdio.h>
#include <string.h>

static const double farthest_from_rotation = 0.05; // of any element of RᵀR from the identity's

// The length of a quaternion says nothing, and the protocol's own examples have one of 0.88; zero
// or another unit does.
static const double shortest_quaternion = 0.5, longest_quaternion = 2;

struct type {
    const char *name;
    enum result (*read)(const struct igtl_content *content, struct igtl_message *out,
                        struct error *err);
};

// ---- poses --------------------------------------------------------------------------------------

static void add_tool(struct igtl_message *m, const char *name, size_t name_size, bool valid,
                     pose p) {
    struct igtl_tool *tool = &m->tools[m->count++];
    *tool = (struct igtl_tool){.has_pose = valid, .T_tracker_tool = valid ? p : pose_identity()};
    igtl_copy_name(tool->name, name, name_size);
}

static void drop_refused(struct igtl_message *m) {
    int kept = 0;
    for (int i = 0; i < m->count; i++)
        if (m->tools[i].has_pose || m->tools[i].unseen)
            m->tools[kept++] = m->tools[i];
    m->refused = m->count - kept;
    m->count = kept;
}

// The nearest rotation: Higham's iteration R <- (R + R⁻ᵀ) / 2 converges to the polar factor.
static mat3 nearest_rotation(mat3 r) {
    for (int i = 0; i < 6; i++) {
        vec3 a = {r.m[0][0], r.m[0][1], r.m[0][2]}, b = {r.m[1][0], r.m[1][1], r.m[1][2]};
        vec3 c = {r.m[2][0], r.m[2][1], r.m[2][2]};
        vec3 x = vec3_cross(b, c), y = vec3_cross(c, a), z = vec3_cross(a, b);
        mat3 cofactors = {{{x.x, x.y, x.z}, {y.x, y.y, y.z}, {z.x, z.y, z.z}}};
        r = mat3_add_scaled(mat3_add_scaled((mat3){0}, 0.5, r), 0.5 / mat3_determinant(r),
                            cofactors);
    }
    return r;
}

// The 12 numbers are columns: the three axes, then the translation.
static bool pose_from_matrix(const float m[12], bool position_only, pose *out) {
    mat3 r;
    for (int i = 0; i < 12; i++)
        if (!isfinite(m[i]))
            return false;
    for (int row = 0; row < 3; row++)
        for (int column = 0; column < 3; column++)
            r.m[row][column] = m[3 * column + row];
    *out = (pose){quat_identity(), {m[9], m[10], m[11]}};
    if (position_only)
        return true;
    mat3 d = mat3_add_scaled(mat3_multiply(mat3_transpose(r), r), -1, mat3_identity());
    for (int i = 0; i < 9; i++)
        if (fabs(d.m[i / 3][i % 3]) > farthest_from_rotation)
            return false;
    if (mat3_determinant(r) < 0)
        return false;
    out->rotation = quat_from_mat3(nearest_rotation(r));
    return true;
}

static bool pose_from_quaternion(const float position[3], quat q, pose *out) {
    double length = sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z);
    *out = (pose){quat_unit(q), {position[0], position[1], position[2]}};
    return vec3_is_finite(out->translation) && length >= shortest_quaternion &&
           length <= longest_quaternion;
}

// ---- types --------------------------------------------------------------------------------------

static enum result wrong_size(const struct igtl_content *c, const char *type, struct error *err) {
    return fail(err, RESULT_FORMAT, "%s with a content of %zu bytes", type, c->size);
}

static enum result read_transform(const struct igtl_content *c, struct igtl_message *out,
                                  struct error *err) {
    float matrix[12];
    pose p;
    if (c->size != sizeof matrix)
        return wrong_size(c, "TRANSFORM", err);
    memcpy(matrix, c->bytes, sizeof matrix);
    igtl_transform_convert_byte_order(matrix);
    bool valid = pose_from_matrix(matrix, false, &p);
    add_tool(out, c->device, IGTL_HEADER_NAME_SIZE, valid, p);
    return RESULT_OK;
}

// A quaternion of three elements leaves out w >= 0; none at all is no rotation.
static enum result read_position(const struct igtl_content *c, struct igtl_message *out,
                                 struct error *err) {
    igtl_position body = {.quaternion = {0, 0, 0, 1}};
    if (c->size > sizeof body)
        return wrong_size(c, "POSITION", err);
    memcpy(&body, c->bytes, c->size);
    switch (c->size) {
    case IGTL_POSITION_MESSAGE_DEFAULT_SIZE:
        igtl_position_convert_byte_order(&body);
        break;
    case IGTL_POSITION_MESSAGE_WITH_QUATERNION3_SIZE:
        igtl_position_convert_byte_order_quaternion3(&body);
        break;
    case IGTL_POSITION_MESSAGE_POSITON_ONLY_SIZE:
        igtl_position_convert_byte_order_position_only(&body);
        break;
    default:
        return wrong_size(c, "POSITION", err);
    }
    float position[3];
    memcpy(position, body.position, sizeof position);
    quat q = {body.quaternion[3], body.quaternion[0], body.quaternion[1], body.quaternion[2]};
    if (c->size == IGTL_POSITION_MESSAGE_WITH_QUATERNION3_SIZE)
        q.w = sqrt(fmax(0, 1 - (q.x * q.x + q.y * q.y + q.z * q.z)));
    pose p;
    bool valid = pose_from_quaternion(position, q, &p);
    add_tool(out, c->device, IGTL_HEADER_NAME_SIZE, valid, p);
    return RESULT_OK;
}

static bool is_tool_type(int type) {
    return type >= IGTL_TDATA_TYPE_TRACKER && type <= IGTL_TDATA_TYPE_5D;
}

static enum result read_tdata(const struct igtl_content *c, struct igtl_message *out,
                              struct error *err) {
    size_t count = c->size / IGTL_TDATA_ELEMENT_SIZE;
    if (c->size % IGTL_TDATA_ELEMENT_SIZE || count > IGTL_TOOLS_MAX)
        return wrong_size(c, "TDATA", err);
    for (size_t i = 0; i < count; i++) {
        igtl_tdata_element element;
        float matrix[12];
        pose p = pose_identity();
        memcpy(&element, c->bytes + i * sizeof element, sizeof element);
        igtl_tdata_convert_byte_order(&element, 1);
        memcpy(matrix, element.transform, sizeof matrix);
        bool valid = is_tool_type(element.type) &&
                     pose_from_matrix(matrix, element.type == IGTL_TDATA_TYPE_3D, &p);
        add_tool(out, element.name, sizeof element.name, valid, p);
    }
    return RESULT_OK;
}

static enum result read_qtdata(const struct igtl_content *c, struct igtl_message *out,
                               struct error *err) {
    size_t count = c->size / IGTL_QTDATA_ELEMENT_SIZE;
    if (c->size % IGTL_QTDATA_ELEMENT_SIZE || count > IGTL_TOOLS_MAX)
        return wrong_size(c, "QTDATA", err);
    for (size_t i = 0; i < count; i++) {
        igtl_qtdata_element element;
        float position[3];
        pose p = pose_identity();
        memcpy(&element, c->bytes + i * sizeof element, sizeof element);
        igtl_qtdata_convert_byte_order(&element, 1);
        memcpy(position, element.position, sizeof position);
        quat q = {element.quaternion[3], element.quaternion[0], element.quaternion[1],
                  element.quaternion[2]};
        if (element.type == IGTL_QTDATA_TYPE_3D)
            q = quat_identity();
        bool valid = is_tool_type(element.type) && pose_from_quaternion(position, q, &p);
        add_tool(out, element.name, sizeof element.name, valid, p);
    }
    return RESULT_OK;
}

// 0: it will send; anything else: it will not.
static enum result read_answer(const struct igtl_content *c, struct igtl_message *out,
                               struct error *err) {
    if (c->size != sizeof(igtl_rts_tdata))
        return wrong_size(c, "RTS_", err);
    out->denied = c->bytes[0] != 0;
    return RESULT_OK;
}

// Code, subcode, name of the error, text.
static enum result read_status(const struct igtl_content *c, struct igtl_message *out,
                               struct error *err) {
    enum { NAME_AT = 10, TEXT_AT = 30 };
    char name[TEXT_AT - NAME_AT + 1], text[IGTL_STATUS_SIZE];
    if (c->size < TEXT_AT)
        return wrong_size(c, "STATUS", err);
    size_t length = c->size - TEXT_AT;
    igtl_copy_name(name, (const char *)c->bytes + NAME_AT, TEXT_AT - NAME_AT);
    igtl_copy_name(text, (const char *)c->bytes + TEXT_AT,
                   length < sizeof text ? length : sizeof text - 1);
    out->status = c->bytes[0] << 8 | c->bytes[1];
    snprintf(out->status_text, sizeof out->status_text, "%s%s%.40s", name,
             name[0] && text[0] ? ": " : "", text);
    for (char *at = out->status_text; *at; at++)
        *at = *at >= ' ' && *at <= '~' ? *at : '?';
    return RESULT_OK;
}

static enum result read_sensor(const struct igtl_content *c, struct igtl_message *out,
                               struct error *err) {
    return igtl_read_sensor(c, &out->sensor, err);
}

// Encoding, length, text.
static enum result read_string(const struct igtl_content *c, struct igtl_message *out,
                               struct error *err) {
    enum { TEXT_AT = 4 };
    size_t length = c->size < TEXT_AT ? 0 : (size_t)(c->bytes[2] << 8 | c->bytes[3]);
    if (c->size < TEXT_AT || length > c->size - TEXT_AT)
        return wrong_size(c, "STRING", err);
    igtl_copy_name(out->text, (const char *)c->bytes + TEXT_AT,
                   length < sizeof out->text ? length : sizeof out->text - 1);
    for (char *at = out->text; *at; at++)
        *at = *at >= ' ' && *at <= '~' ? *at : '?';
    return RESULT_OK;
}

static const struct type types[] = {
    {"RTS_TDATA", read_answer},  {"RTS_QTDATA", read_answer}, {"TRANSFORM", read_transform},
    {"POSITION", read_position}, {"TDATA", read_tdata},       {"QTDATA", read_qtdata},
    {"STATUS", read_status},     {"SENSOR", read_sensor},     {"STRING", read_string},
};

// ---- the stream ---------------------------------------------------------------------------------

static const struct type *type_of(const struct igtl_frame *frame) {
    for (size_t i = 0; i < sizeof types / sizeof *types && frame->known; i++)
        if (!strcmp(frame->type, types[i].name))
            return &types[i];
    return NULL;
}

static enum igtl_event read_content(const struct type *type, const struct igtl_frame *frame,
                                    struct igtl_message *out, struct error *err) {
    struct igtl_content content;
    out->names_tools = type->read == read_tdata || type->read == read_qtdata;
    if (igtl_frame_content(frame, &content, err) != RESULT_OK ||
        type->read(&content, out, err) != RESULT_OK)
        return IGTL_REFUSED;
    if (type->read == read_answer)
        return out->denied ? IGTL_DENIED : IGTL_SKIPPED;
    if (type->read == read_status)
        return IGTL_STATUS;
    if (type->read == read_sensor)
        return IGTL_SENSOR;
    if (type->read == read_string)
        return IGTL_STRING;
    if (igtl_read_tool_metadata(&content, out, err) != RESULT_OK)
        return IGTL_REFUSED;
    drop_refused(out);
    if (!out->count && out->refused) {
        fail(err, RESULT_INVALID, "%s: no valid rotation", type->name);
        return IGTL_REFUSED;
    }
    return IGTL_POSES;
}

static enum igtl_event read_message(const struct igtl_frame *frame, struct igtl_message *out,
                                    struct error *err) {
    const struct type *type = type_of(frame);
    out->count = out->refused = 0;
    out->denied = false;
    out->stamp_ns = igtl_stamp_ns(frame->stamp);
    out->version = frame->version;
    memcpy(out->type, frame->type, sizeof out->type);
    memcpy(out->device, frame->device, sizeof out->device);
    if (!frame->known)
        return IGTL_SKIPPED;
    if (!frame->intact) {
        fail(err, RESULT_CORRUPT, "%s: wrong checksum", type ? type->name : "a message");
        return IGTL_REFUSED;
    }
    return type ? read_content(type, frame, out, err) : IGTL_SKIPPED;
}

void igtl_stream_init(struct igtl_stream *s) {
    igtl_framing_init(&s->framing);
}

size_t igtl_stream_feed(struct igtl_stream *s, const uint8_t *bytes, size_t size,
                        enum igtl_event *out_event, struct igtl_message *out_message,
                        struct error *err) {
    struct igtl_frame frame;
    enum igtl_framing_event event;
    size_t taken = igtl_framing_feed(&s->framing, bytes, size, &event, &frame, err);
    *out_event = event == IGTL_FRAMING_PART     ? IGTL_NOTHING
                 : event == IGTL_FRAMING_BROKEN ? IGTL_BROKEN
                                                : read_message(&frame, out_message, err);
    return taken;
}
