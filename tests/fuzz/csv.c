// A recording of one tool, a motion file or a sequence metafile.
#include "base/check.h"
#include "drivers/recording.h"
#include "fuzz/fuzz.h"

static void read_at(const struct recording *r, double t) {
    int row = recording_row_at(r, t);
    CHECK(row >= 0 && row < r->row_count);
    if (r->joints)
        CHECK(isfinite(recording_joint_at(r, t).flexion_deg));
    for (int i = 0; i < r->tool_count; i++)
        CHECK(pose_is_valid(recording_tool_at(r, i, t).pose));
}

static void read_as(const char *path, enum channel unnamed) {
    struct recording r = {0};
    struct error err;
    if (recording_read(path, unnamed, &r, &err) == RESULT_OK) {
        CHECK(r.row_count >= 1);
        double first = r.t_seconds[0], last = r.t_seconds[r.row_count - 1];
        CHECK(recording_period(&r) > 0);
        for (int i = 0; i <= 8; i++)
            read_at(&r, first + (last - first) * (i - 1) / 6);
    }
    recording_fini(&r);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    const char *path = fuzz_file("a.csv", data, size);
    read_as(path, CHANNEL_PROBE);
    read_as(path, CHANNEL_COUNT);
    return 0;
}
