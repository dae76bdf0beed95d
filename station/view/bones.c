#include "view/bones.h"

static enum validity worse(enum validity a, enum validity b) {
    return a > b ? a : b;
}

static void take_joint(struct bones *b, const struct sample *sample) {
    b->joint_validity = sample->validity;
    if (sample->validity == VALIDITY_LOST)
        return;
    b->joint_known = true;
    b->joint = sample->joint;
}

static void take_pose(struct bones *b, enum bone bone, const struct sample *sample) {
    b->tracked_validity[bone] = sample->validity;
    if (sample->validity == VALIDITY_LOST)
        return;
    b->tracked[bone] = true;
    b->T_mockup_tracked[bone] = sample->T_mockup_body;
}

void bones_take(struct bones *b, const struct frame *frame) {
    for (int i = 0; i < frame->count; i++) {
        const struct sample *sample = &frame->samples[i];
        if (sample->kind == SAMPLE_JOINT)
            take_joint(b, sample);
        else if (sample->kind == SAMPLE_POSE && sample->channel < CHANNEL_FIRST_INSTRUMENT)
            take_pose(b, (enum bone)(sample->channel - CHANNEL_FEMUR), sample);
    }
}

static struct bone_place tracked_place(const struct bones *b, enum bone bone) {
    return (struct bone_place){b->T_mockup_tracked[bone], b->tracked_validity[bone]};
}

// A tracked tibia wins over the joint's encoders, unless it is lost and they are not.
static bool tibia_is_tracked(const struct bones *b) {
    bool encoders_good = b->joint_known && b->joint_validity != VALIDITY_LOST;
    return b->tracked[BONE_TIBIA] &&
           (b->tracked_validity[BONE_TIBIA] != VALIDITY_LOST || !encoders_good);
}

void bones_place(const struct bones *b, struct bone_place out[BONE_COUNT]) {
    struct bone_place femur = {pose_identity(), VALIDITY_OK};
    if (b->tracked[BONE_FEMUR])
        femur = tracked_place(b, BONE_FEMUR);
    struct bone_place tibia = {femur.T_mockup_body, VALIDITY_LOST};
    double flexion_deg = 0;
    if (tibia_is_tracked(b)) {
        tibia = tracked_place(b, BONE_TIBIA);
        pose T_femur_tibia = pose_compose(pose_inverse(femur.T_mockup_body), tibia.T_mockup_body);
        flexion_deg = joint_from_pose(&b->knee.joint, T_femur_tibia).flexion_deg;
    } else if (b->has_knee) {
        pose T_femur_tibia = joint_to_pose(&b->knee.joint, &b->joint);
        tibia.T_mockup_body = pose_compose(femur.T_mockup_body, T_femur_tibia);
        if (b->joint_known)
            tibia.validity = worse(b->joint_validity, femur.validity);
        flexion_deg = b->joint.flexion_deg;
    }
    struct bone_place patella = {femur.T_mockup_body, VALIDITY_LOST};
    if (b->tracked[BONE_PATELLA]) {
        patella = tracked_place(b, BONE_PATELLA);
    } else if (b->has_knee) {
        pose T_femur_patella = patella_pose(b->knee.patella, b->knee.patella_count, flexion_deg);
        patella.T_mockup_body = pose_compose(femur.T_mockup_body, T_femur_patella);
        patella.validity = worse(tibia.validity, femur.validity);
    }
    out[BONE_FEMUR] = femur;
    out[BONE_TIBIA] = tibia;
    out[BONE_PATELLA] = patella;
}
