#include "step/field_types.h"

#include "step/fields.h"
#include "step/input.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#define DEFINE_NUMBER(name, c_type)                                                                \
    static double number_##name(const void *value) {                                               \
        c_type v;                                                                                  \
        memcpy(&v, value, sizeof v);                                                               \
        return (double)v;                                                                          \
    }

#define DEFINE_TYPE(name, c_type, encoded, least, most, format, shown)                             \
    DEFINE_NUMBER(name, c_type)                                                                    \
    static void print_##name(const void *value, char *out) {                                       \
        c_type v;                                                                                  \
        memcpy(&v, value, sizeof v);                                                               \
        snprintf(out, FIELD_TEXT_MAX, format, shown);                                              \
    }                                                                                              \
    const struct field_type field_##name = {sizeof(c_type), encoded,       least,                  \
                                            most,           number_##name, print_##name}

#define DEFINE_NAMED(name, c_type, least, count, name_of)                                          \
    DEFINE_TYPE(name, enum c_type, 1, least, (count)-1, "%s", name_of(v))

DEFINE_TYPE(real, double, 8, 0, 0, "%.17g", v);
DEFINE_TYPE(count, uint64_t, 8, 0, 0, "%" PRIu64, v);
DEFINE_TYPE(time, int64_t, 8, 0, 0, "%" PRId64, v);
DEFINE_TYPE(bits, uint32_t, 4, 0, 0, "%" PRIu32, v);
DEFINE_TYPE(hash, uint64_t, 8, 0, 0, "%016" PRIx64, v);
DEFINE_TYPE(flag, bool, 1, 0, 1, "%d", v);
DEFINE_TYPE(tissue, int, 1, 0, TISSUES_MAX - 1, "%d", v);
DEFINE_TYPE(nearest, int, 4, -1, WARP_SURFACES_MAX - 1, "%d", v);
DEFINE_TYPE(torn_count, int, 1, 0, ADAPTIVE_LIGAMENTS_MAX, "%d", v);
DEFINE_TYPE(move_count, int, 1, 1, JOB_MOVES_MAX, "%d", v);
DEFINE_TYPE(carrier, int, 1, 0, BODY_COUNT + INSTRUMENT_COUNT - 1, "%s", output_carrier_name(v));
DEFINE_NAMED(loose, loose_state, 0, LOOSE_STATE_COUNT, loose_state_name);
DEFINE_NAMED(state, session_state, 0, SESSION_STATE_COUNT, session_state_name);
DEFINE_NAMED(validity, validity, 0, VALIDITY_COUNT, validity_name);
DEFINE_TYPE(blade, int, 1, 0, BLADE_MOST, "%s", channel_name((enum channel)(v + CHANNEL_PUNCH)));
DEFINE_NAMED(job, job_kind, JOB_NONE + 1, JOB_KIND_COUNT, job_kind_name);
DEFINE_NAMED(mode, avatar_mode, 0, AVATAR_MODE_COUNT, avatar_mode_name);
DEFINE_NAMED(outcome, job_outcome, 0, JOB_OUTCOME_COUNT, job_outcome_name);

DEFINE_NAMED(input, input_kind, 0, INPUT_KIND_COUNT, input_kind_name);

DEFINE_NUMBER(events, uint32_t)

static void print_events(const void *value, char *out) {
    uint32_t events;
    memcpy(&events, value, sizeof events);
    size_t used = 0;
    out[0] = '\0';
    for (int i = 0; i < EVENT_COUNT; i++)
        if (events >> i & 1)
            used += (size_t)snprintf(out + used, FIELD_TEXT_MAX - used, "%s%s", used ? "+" : "",
                                     event_name(i));
}

const struct field_type field_events = {sizeof(uint32_t), 4, 0, 0, number_events, print_events};
