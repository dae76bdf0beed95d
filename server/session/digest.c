#include "session/digest.h"

#include "base/bytes.h"
#include "base/check.h"

#include <xxhash.h>

void digest_write_instrument(struct writer *w, const struct instrument_output *o) {
    write_u8(w, o->present);
    if (!o->present)
        return;
    write_u8(w, (uint8_t)o->validity);
    write_pose(w, o->T_mockup_tip);
    write_pose(w, o->T_mockup_warped);
    write_vec3(w, o->warp.displacement);
    for (int i = 0; i < 9; i++)
        write_f64(w, o->warp.gradient.m[i / 3][i % 3]);
    write_f64(w, o->warp.trust_radius_mm);
    write_u32(w, (uint32_t)o->warp.nearest);
    write_f64(w, o->warp.nearest_mm);
    write_f64(w, o->gain);
    write_f64(w, o->handle.opening);
    write_u32(w, o->handle.buttons);
}

uint64_t digest_output(uint64_t previous, const struct session_output *out) {
    uint8_t data[2048];
    struct writer w = {data, sizeof data, 0, false};
    write_u64(&w, previous);
    write_u64(&w, out->step);
    write_u64(&w, out->frame_number);
    write_i64(&w, out->time_ns);
    write_u8(&w, (uint8_t)out->state);
    write_u32(&w, out->events);
    write_f64(&w, out->joint.flexion_deg);
    write_f64(&w, out->joint.varus_deg);
    write_f64(&w, out->joint.internal_deg);
    write_f64(&w, out->joint.shift_mm);
    write_f64(&w, out->joint.drawer_mm);
    write_f64(&w, out->joint.distraction_mm);
    write_u8(&w, (uint8_t)out->joint_validity);
    for (int i = 0; i < BODY_COUNT; i++)
        write_pose(&w, out->T_mockup_body[i]);
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        digest_write_instrument(&w, &out->instruments[i]);
    CHECK(!w.overflow);
    return XXH3_64bits(data, w.used);
}
