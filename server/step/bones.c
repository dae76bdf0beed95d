#include "step/bones.h"

static enum validity worse(enum validity a, enum validity b) {
    return a > b ? a : b;
}

// A tracked tibia wins over the joint's encoders, unless it is lost and they are not.
static bool is_tracked(const struct sample *tibia, const struct sample *encoders) {
    bool encoders_good = encoders && encoders->validity != VALIDITY_LOST;
    return tibia && (tibia->validity != VALIDITY_LOST || !encoders_good);
}

static void place_tracked_tibia(const struct sample *tibia, const struct sample *femur,
                                const struct joint_frame *joint, struct session_output *out) {
    pose *bodies = out->T_mockup_body;
    bodies[BODY_TIBIA] = tibia->T_mockup_body;
    pose T_mockup_femur = bodies[BODY_FEMUR];
    out->joint =
        joint_from_pose(joint, pose_compose(pose_inverse(T_mockup_femur), bodies[BODY_TIBIA]));
    out->joint_validity = femur ? worse(tibia->validity, femur->validity) : tibia->validity;
}

static void place_tibia_by_encoders(const struct sample *encoders, const struct joint_frame *joint,
                                    struct session_output *out) {
    pose *bodies = out->T_mockup_body;
    out->joint = encoders ? encoders->joint : (struct joint_angles){0};
    out->joint_validity = encoders ? encoders->validity : VALIDITY_LOST;
    bodies[BODY_TIBIA] = pose_compose(bodies[BODY_FEMUR], joint_to_pose(joint, &out->joint));
}

void step_bones_place(const struct samples *samples, const struct knee_case *knee,
                      struct session_output *out) {
    const struct sample *femur = samples_last(samples, CHANNEL_FEMUR, SAMPLE_POSE);
    const struct sample *tibia = samples_last(samples, CHANNEL_TIBIA, SAMPLE_POSE);
    const struct sample *patella = samples_last(samples, CHANNEL_PATELLA, SAMPLE_POSE);
    const struct sample *encoders = samples_last(samples, CHANNEL_JOINT, SAMPLE_JOINT);
    pose *bodies = out->T_mockup_body;
    bodies[BODY_FEMUR] = femur ? femur->T_mockup_body : pose_identity();
    if (is_tracked(tibia, encoders))
        place_tracked_tibia(tibia, femur, &knee->joint, out);
    else
        place_tibia_by_encoders(encoders, &knee->joint, out);
    pose T_femur_patella = case_patella_pose(knee, out->joint.flexion_deg);
    bodies[BODY_PATELLA] =
        patella ? patella->T_mockup_body : pose_compose(bodies[BODY_FEMUR], T_femur_patella);
}
