// Arthron's messages as bytes, and as the plain types of base/. No sockets, no clock, no memory of
// its own: bytes in, bytes out. The schema is arthron.proto; PROTOCOL.md says who sends what when.
#pragma once

#include "arthron.pb.h"
#include "base/extrapolation.h"
#include "base/instrument.h"
#include "base/marker.h"
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

#define WIRE_DEVICES_MAX 16           // in Hello, and so in a sample's index
#define WIRE_SAMPLES_WITHOUT_FORCE 16 // in a Frame to a server without the capability "force"
#define WIRE_REPLY_INSTRUMENTS 5      // in a Reply; where more are present, they take turns
#define WIRE_REPLY_LOOSE 2            // in a Reply; where a case has more, they take turns
#define WIRE_LOOSE_MAX 8              // loose bodies of a case

// Largest encoded message of each kind. A longer one is refused before it is decoded.
#define WIRE_CONTROL_MAX 8192
#define WIRE_CONSOLE_MAX 65536
#define WIRE_DATAGRAM_MAX 1452
#define WIRE_VIEW_MAX 4096
#define WIRE_CHUNK_MAX 33024 // a Control that holds a MeshChunk
#define WIRE_PAGE_MAX 4096   // a page's message

#define WIRE_CHUNK_DATA 32768     // bytes of a mesh in each chunk but the last
#define WIRE_MESH_MAX (64u << 20) // bytes in all chunks together
#define WIRE_MESH_GROUPS_MAX 8    // that a station follows at once

// Times on the wire lie in [0, WIRE_TIME_MAX_NS): 36 years of a monotonic clock.
#define WIRE_TIME_MAX_NS (INT64_C(1) << 60)

// Encode into `data`. RESULT_LIMIT: the message does not fit `size`.
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

// Decode all of `data`. RESULT_LIMIT: it is longer than its kind may be. RESULT_FORMAT: the decoder
// refused it; *err says why, and no part of the message may be used. After RESULT_OK
//   texts are terminated, counts within their arrays, and enums known (a Refusal's unknown reason
//   becomes UNKNOWN);
//   a Hello's residuals are not negative, and its instruments are good descriptions;
//   a Control's Marker passes wire_marker_to;
//   each instrument of a Reply that is not lost has a finite pose and a finite extrapolation;
//   each loose body of a Reply has a number below WIRE_LOOSE_MAX and a carrier, and a finite pose
//   unless it is OUT;
//   corrections are poses, a SessionChange's knee is valid, and a CommandReply's joint is finite.
// The handler of a Command looks up the names in it (stations, cases, sessions, files). A message
// of a kind that this version does not know is RESULT_OK with which_message == 0: skip and count
// it.
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

// A Control with only a MeshChunk, for which struct arthron_Control has no room.
// wire_decode_control refuses it (RESULT_FORMAT). After RESULT_OK number is above base, size at
// most WIRE_MESH_MAX, index within it, and data has the length for this index.
enum result wire_encode_chunk(const arthron_MeshChunk *chunk, uint8_t *data, size_t size,
                              size_t *out_used);
bool wire_is_chunk(const uint8_t *data, size_t size); // looks only at the kind of message
enum result wire_decode_chunk(const uint8_t *data, size_t size, arthron_MeshChunk *out_chunk,
                              struct error *err);

void wire_frame_from(const struct frame *frame, arthron_Frame *out_message);

// RESULT_INVALID: the frame does not pass frame_is_valid, or a device is not below
// WIRE_DEVICES_MAX. No part of *out_frame may then be used.
enum result wire_frame_to(const arthron_Frame *message, struct frame *out_frame, struct error *err);

// Both for a datagram: wire_decode_frame and wire_frame_to, and their results. After RESULT_INVALID
// *out_frame has its number.
enum result wire_read_frame(const uint8_t *data, size_t size, struct frame *out_frame,
                            struct error *err);

// True where wire_frame_to takes a frame with these values.
bool wire_frame_is_sane(const struct frame *frame);

// Leaves out what the receiver would refuse the whole frame for: without the capability
// "instruments" the channels of described ones; without "force" every force, and what is beyond
// WIRE_SAMPLES_WITHOUT_FORCE samples. False: something else than a described instrument is left
// out.
bool wire_frame_reduce(arthron_Frame *message, bool instruments, bool force);

// The extrapolation of an instrument's avatar, in the frame of its body. The first sets the
// message's extrapolation and trust radius, rounded to floats. The second reads them from a decoded
// instrument that is not LOST.
void wire_extrapolation_from(const struct avatar_extrapolation *extrapolation,
                             arthron_WarpedInstrument *out_instrument);
struct avatar_extrapolation wire_extrapolation_to(const arthron_WarpedInstrument *instrument);

// Pads a frame's datagram so that the encoded frame is at least as long as the longest reply to it
// can be (a server is no amplifier). Its channels must be known ones. Not for the control
// connection.
void wire_frame_pad(arthron_Frame *message);

// Instruments: the described ones of Hello, or all of a session. wire_instruments_to adds them to
// the usual ones. RESULT_INVALID: a channel is out of turn, or a description is not good
// (base/instrument.h); the error says which, and why.
void wire_instrument_from(const struct instruments *instruments, int index,
                          arthron_Instrument *out_message);
void wire_session_instruments_from(const struct instruments *instruments,
                                   arthron_LiveSession *out_session);
enum result wire_instruments_to(const arthron_Hello *hello, struct instruments *out_instruments,
                                struct error *err);

// A marker. wire_marker_to does not set its run. RESULT_FORMAT: it does not pass marker_is_valid,
// or its time is out of range.
arthron_Marker wire_marker_from(const struct marker *marker);
enum result wire_marker_to(const arthron_Marker *message, struct marker *out_marker,
                           struct error *err);

// How a case's bones are joined. wire_knee_to takes a decoded message.
void wire_knee_from(const struct knee_frame *knee, arthron_Knee *out_message);
void wire_knee_to(const arthron_Knee *message, struct knee_frame *out_knee);

arthron_Joint wire_joint_from(const struct joint_angles *angles);
struct joint_angles wire_joint_to(const arthron_Joint *message);
arthron_Pose wire_pose_from(pose p);
pose wire_pose_to(const arthron_Pose *message);
arthron_ShortPose wire_short_pose_from(pose p);
pose wire_short_pose_to(const arthron_ShortPose *message); // of four and three finite numbers
