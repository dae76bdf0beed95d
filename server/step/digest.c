#include "step/digest.h"

#include "base/bytes.h"
#include "base/check.h"

#include <string.h>
#include <xxhash.h>

// That of `tip` is the space warp's.
static void write_lead(struct writer *w, const struct avatar_lead *lead) {
    write_u8(w, (uint8_t)lead->mode);
    if (lead->mode == AVATAR_TIP)
        return;
    write_vec3(w, lead->portal);
    write_vec3(w, lead->motion.v);
    write_f64(w, lead->motion.s);
    for (int i = 0; i < 24; i++)
        write_f64(w, lead->slope[i / 6][i % 6]);
    write_f64(w, lead->reach_mm);
    write_f64(w, lead->trust_radius_mm);
}

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
    write_lead(w, &o->lead);
    write_f64(w, o->penetration_mm);
    write_f64(w, o->tip_gap_mm);
    write_f64(w, o->discrepancy.offset_mm);
    write_f64(w, o->discrepancy.tilt_deg);
    write_f64(w, o->discrepancy.gain);
    write_f64(w, o->discrepancy.gain_least);
    write_f64(w, o->discrepancy.turn_deg);
    write_f64(w, o->handle.opening);
    write_u32(w, o->handle.buttons);
    write_u8(w, (uint8_t)o->handle_validity);
}

// A virtual bone is told where it is elsewhere than the mock-up's.
void digest_write_bones(struct writer *w, const struct session_output *out) {
    for (int i = 0; i < BODY_COUNT; i++) {
        const pose *physical = &out->T_mockup_body[i], *virtual = &out->T_mockup_virtual[i];
        bool elsewhere = memcmp(physical, virtual, sizeof *virtual) != 0;
        write_pose(w, *physical);
        write_u8(w, elsewhere);
        if (elsewhere)
            write_pose(w, *virtual);
    }
    write_u8(w, (uint8_t)out->torn_count);
    for (int i = 0; i < out->torn_count; i++) {
        write_f64(w, out->opening[i]);
        write_f64(w, out->share[i]);
    }
}

void digest_write_job(struct writer *w, const struct job *job) {
    write_u64(w, job->id);
    if (!job->id)
        return;
    write_u8(w, (uint8_t)job->kind);
    write_u8(w, (uint8_t)job->tissue);
    if (job->kind != JOB_CUT)
        return;
    write_u32(w, job->stroke);
    write_u8(w, (uint8_t)job->move.kind);
    for (int i = 0; i < 2; i++) {
        write_pose(w, job->move.T_mesh_tip[i]);
        write_f64(w, job->move.opening[i]);
    }
}

static void write_zones(struct writer *w, const struct zone_volumes *zones) {
    for (int i = 0; i < ZONE_ALONG_COUNT; i++)
        for (int k = 0; k < ZONE_ACROSS_COUNT; k++)
            write_f64(w, zones->mm3[i][k]);
}

static void write_figures(struct writer *w, const struct tissue_figures *f) {
    write_u32(w, f->mesh_number);
    write_u32(w, f->cuts);
    write_u32(w, f->refused);
    write_u32(w, f->pieces);
    write_f64(w, f->volume_mm3);
    write_f64(w, f->removed_mm3);
    write_f64(w, f->pieces_mm3);
    write_f64(w, f->warped_mm3);
    write_f64(w, f->left_mm3);
    write_f64(w, f->distance_mm);
    write_f64(w, f->quality.removed_mm3);
    write_f64(w, f->quality.planned_mm3);
    write_f64(w, f->quality.over_mm3);
    write_f64(w, f->quality.under_mm3);
    write_f64(w, f->quality.damage_mm3);
    write_f64(w, f->quality.rim_mm);
    write_f64(w, f->quality.step_mm);
    write_zones(w, &f->quality.whole);
    write_zones(w, &f->quality.removed);
    write_zones(w, &f->quality.budget);
}

void digest_write_landed(struct writer *w, const struct landed *landed) {
    write_u64(w, landed->job);
    if (!landed->job)
        return;
    write_u8(w, (uint8_t)landed->outcome);
    write_u8(w, (uint8_t)landed->tissue);
    write_figures(w, &landed->figures);
    write_u64(w, landed->hash);
}

uint64_t digest_output(uint64_t previous, const struct session_output *out) {
    uint8_t data[8192];
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
    digest_write_bones(&w, out);
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        digest_write_instrument(&w, &out->instruments[i]);
    digest_write_job(&w, &out->job);
    digest_write_landed(&w, &out->landed);
    CHECK(!w.overflow);
    return XXH3_64bits(data, w.used);
}
