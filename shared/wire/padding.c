// How long frames and replies are at most, and the padding that follows from it.
#include "base/check.h"
#include "wire/seal.h"
#include "wire/wire.h"

#include <pb_encode.h>

// What a repeated message takes besides itself: its tag, and its length in up to two bytes.
#define PADDED_OVERHEAD 3
#define CHANNEL_SPARE 1 // a channel is below 128: a byte less than the schema has room for
#define SAMPLE_OVERHEAD (2 - CHANNEL_SPARE) // its length is below 128
#define FRAME_EMPTY_SIZE 18                 // number and time
#define INSTRUMENT_SIZE (arthron_WarpedInstrument_size - CHANNEL_SPARE + PADDED_OVERHEAD)
#define COUNTS_SIZE (sizeof((arthron_Reply){0}.event_counts) / sizeof(uint32_t) * 6)
#define CHALLENGE_SIZE 9
#define FRAMES_SIZE 12                                                  // lost ones and late ones
#define LOOSE_SIZE (WIRE_REPLY_LOOSE * (arthron_CarriedLoose_size + 2)) // with a tag and a length
#define REPLY_SIZE                                                                                 \
    (arthron_Reply_size - WIRE_REPLY_INSTRUMENTS * CHANNEL_SPARE - COUNTS_SIZE - CHALLENGE_SIZE -  \
     FRAMES_SIZE - LOOSE_SIZE) // these where there is room
#define REPLY_EMPTY_SIZE (REPLY_SIZE - WIRE_REPLY_INSTRUMENTS * INSTRUMENT_SIZE)
#define PADDING_OVERHEAD 3

_Static_assert(REPLY_EMPTY_SIZE > 0, "Reply holds its instruments");
_Static_assert(CHANNEL_COUNT < 128 && arthron_Sample_size < 128,
               "a channel and a sample's length take one byte");

#define BONE_COUNT (CHANNEL_FIRST_INSTRUMENT - CHANNEL_FEMUR)
#define SAMPLE_POSE_SIZE (arthron_Sample_size + SAMPLE_OVERHEAD)
#define SAMPLE_JOINT_SIZE (SAMPLE_POSE_SIZE - arthron_Pose_size + arthron_Joint_size)
#define SAMPLE_HANDLE_SIZE (SAMPLE_POSE_SIZE - arthron_Pose_size + arthron_Handle_size)
#define SAMPLE_FORCE_SIZE (SAMPLE_POSE_SIZE - arthron_Pose_size - 1 + 8) // without a length
#define SAMPLE_FORCES (FRAME_SAMPLES_MAX - 1 - BONE_COUNT - 2 * INSTRUMENT_COUNT)

_Static_assert(SAMPLE_FORCES >= 0 && FRAME_EMPTY_SIZE + SAMPLE_JOINT_SIZE +
                                             (BONE_COUNT + INSTRUMENT_COUNT) * SAMPLE_POSE_SIZE +
                                             INSTRUMENT_COUNT * SAMPLE_HANDLE_SIZE +
                                             SAMPLE_FORCES * SAMPLE_FORCE_SIZE + SEAL_OVERHEAD <=
                                         WIRE_DATAGRAM_MAX,
               "the longest frame with one sample of each kind and channel fits a datagram");
_Static_assert(REPLY_SIZE + PADDING_OVERHEAD + SEAL_OVERHEAD <= WIRE_DATAGRAM_MAX,
               "every padded frame fits a datagram");
_Static_assert(REPLY_SIZE <= sizeof((arthron_Frame){0}.padding.bytes),
               "padding reaches the longest reply");

static size_t longest_reply(const arthron_Frame *m) {
    bool there[CHANNEL_COUNT] = {false};
    int instruments = 0;
    for (int i = 0; i < m->samples_count; i++) {
        int channel = (int)m->samples[i].channel;
        instruments += channel >= CHANNEL_FIRST_INSTRUMENT && !there[channel];
        there[channel] = true;
    }
    int told = instruments < WIRE_REPLY_INSTRUMENTS ? instruments : WIRE_REPLY_INSTRUMENTS;
    return REPLY_EMPTY_SIZE + (size_t)told * INSTRUMENT_SIZE;
}

void wire_frame_pad(arthron_Frame *m) {
    size_t size = 0, wanted = longest_reply(m);
    m->padding.size = 0;
    bool sized = pb_get_encoded_size(&size, arthron_Frame_fields, m);
    CHECK(sized);
    if (size < wanted) // the padding's own tag and length come on top
        m->padding.size = (pb_size_t)(wanted - size);
}
