// Arthron's messages as bytes, and as the plain types of base/. No sockets, no clock, no memory of
// its own: bytes in, bytes out. The schema is arthron.proto; PROTOCOL.md says who sends what when.
#pragma once

#include "arthron.pb.h"
#include "base/extrapolation.h"
#include "base/result.h"
#include "base/sample.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define WIRE_VERSION_MIN 1
#define WIRE_VERSION_MAX 1
#define WIRE_SUBPROTOCOL "arthron.1"
#define WIRE_ENROL_SUBPROTOCOL "arthron-enrol.1"
#define WIRE_CONSOLE_SUBPROTOCOL "arthron-console.1"
#define WIRE_VIEW_SUBPROTOCOL "arthron-view.1"
#define WIRE_LIVE_SUBPROTOCOL "arthron-live.1"

#define WIRE_DEVICES_MAX 16 // in Hello, and so in a sample's index

// Largest encoded message of each kind; what is longer is refused before it is read.
#define WIRE_CONTROL_MAX 8192
#define WIRE_CONSOLE_MAX 65536
#define WIRE_DATAGRAM_MAX 1452
#define WIRE_VIEW_MAX 2048
#define WIRE_CHUNK_MAX 33024 // a Control that holds a MeshChunk
#define WIRE_PAGE_MAX 4096   // what a page says

#define WIRE_CHUNK_DATA 32768     // in each piece of a mesh but the last
#define WIRE_MESH_MAX (64u << 20) // in all of them together
#define WIRE_MESH_GROUPS_MAX 8    // that a station follows at once

// Times on the wire lie in [0, WIRE_TIME_MAX_NS): 36 years of a monotonic clock.
#define WIRE_TIME_MAX_NS (INT64_C(1) << 60)

// Encode into `data`. RESULT_LIMIT where it does not fit `size`.
enum result wire_encode_control(const arthron_Control *message, uint8_t *data, size_t size,
                                size_t *out_used);
enum result wire_encode_console(const arthron_Console *message, uint8_t *data, size_t size,
                                size_t *out_used);
enum result wire_encode_frame(const arthron_Frame *message, uint8_t *data, size_t size,
                              size_t *out_used);
enum result wire_encode_reply(const arthron_Reply *message, uint8_t *data, size_t size,
                              size_t *out_used);
enum result wire_encode_view(const arthron_View *message, uint8_t *data, size_t size,
                             size_t *out_used);

// Decode all of `data`. RESULT_LIMIT where it is longer than its kind may be; RESULT_FORMAT with
// what the decoder disliked in *err: nothing of the message may then be used. After RESULT_OK texts
// are terminated, counts within their arrays, enums known (a Refusal's unknown reason becomes
// UNKNOWN), a Hello's residuals not negative, and in a Reply each instrument that is not lost has a
// pose and a extrapolation, both finite, each correction is a pose, a SessionChange's knee is one,
// and a CommandReply's joint is finite. What a Command names (stations, cases, sessions, files) is
// its handler's to look up: where one may name a file is known there. A message of a kind that this
// version does not know is RESULT_OK with which_message == 0: skip and count it.
enum result wire_decode_control(const uint8_t *data, size_t size, arthron_Control *out_message,
                                struct error *err);
enum result wire_decode_console(const uint8_t *data, size_t size, arthron_Console *out_message,
                                struct error *err);
enum result wire_decode_frame(const uint8_t *data, size_t size, arthron_Frame *out_message,
                              struct error *err);
enum result wire_decode_reply(const uint8_t *data, size_t size, arthron_Reply *out_message,
                              struct error *err);
enum result wire_decode_page(const uint8_t *data, size_t size, arthron_Page *out_message,
                             struct error *err);

// A Control that holds a MeshChunk and nothing else: struct arthron_Control has no place for one.
// wire_decode_control refuses it (RESULT_FORMAT). After RESULT_OK number is above base, size at
// most WIRE_MESH_MAX, index within it, and data as long as its place demands.
enum result wire_encode_chunk(const arthron_MeshChunk *chunk, uint8_t *data, size_t size,
                              size_t *out_used);
bool wire_is_chunk(const uint8_t *data, size_t size); // whatever else is wrong with it
enum result wire_decode_chunk(const uint8_t *data, size_t size, arthron_MeshChunk *out_chunk,
                              struct error *err);

void wire_frame_from(const struct frame *frame, arthron_Frame *out_message);

// RESULT_INVALID where the frame would not pass frame_is_valid, or a device is not below
// WIRE_DEVICES_MAX; nothing of it may then be used.
enum result wire_frame_to(const arthron_Frame *message, struct frame *out_frame, struct error *err);

// How an instrument's avatar goes on with the hand, in the frame of its body: sets the instrument's
// extrapolation and trust radius, and gives them back from a decoded one that is not LOST. Values
// are rounded to floats.
void wire_extrapolation_from(const struct avatar_extrapolation *extrapolation,
                             arthron_WarpedInstrument *out_instrument);
struct avatar_extrapolation wire_extrapolation_to(const arthron_WarpedInstrument *instrument);

// Pads a frame's datagram so that the encoded frame is at least as long as the longest reply to it
// can be (a server is no amplifier). Its channels must be known ones. Not for the control
// connection.
void wire_frame_pad(arthron_Frame *message);

// How a case's bones hang together; from a decoded message.
void wire_knee_from(const struct knee_frame *knee, arthron_Knee *out_message);
void wire_knee_to(const arthron_Knee *message, struct knee_frame *out_knee);

arthron_Joint wire_joint_from(const struct joint_angles *angles);
struct joint_angles wire_joint_to(const arthron_Joint *message);
arthron_Pose wire_pose_from(pose p);
pose wire_pose_to(const arthron_Pose *message);
