// Scripts of motions in a test's text, and what their motions do.
#pragma once

#include "folder.h"
#include "motion/motion.h"
#include "test.h"

#include <stdio.h>

static inline enum result load_text(const char *text, struct motion_script *out_script,
                                    struct error *err) {
    char folder[FOLDER_MAX], path[128];
    folder_make(folder);
    snprintf(path, sizeof path, "%s/motion.ini", folder);
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs(text, file);
    fclose(file);
    enum result result = motion_script_load(path, out_script, err);
    folder_remove(folder);
    return result;
}

static inline void plan_script(struct knee_case *on, const struct motion_script *script,
                               struct motion *out_motion) {
    struct error err;
    if (motion_plan(on, script, out_motion, &err) != RESULT_OK)
        fail_msg("%s", err.text);
}

static inline void plan_text(struct knee_case *on, const char *text, struct motion *out_motion) {
    struct motion_script script;
    struct error err;
    if (load_text(text, &script, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    plan_script(on, &script, out_motion);
}

static inline char *written(const struct motion *motion) {
    char *text;
    size_t size;
    FILE *file = open_memstream(&text, &size);
    struct error err;
    assert_int_equal(motion_write(motion, file, &err), RESULT_OK);
    fclose(file);
    return text;
}

static inline int tool_index(const struct motion *motion, enum channel channel) {
    for (int i = 0; i < motion->tool_count; i++)
        if (motion->tools[i].channel == channel)
            return i;
    fail_msg("no %s", channel_name(channel));
    return -1;
}

static inline pose body_pose(const struct knee_case *knee, const struct joint_angles *joint,
                             enum body body) {
    if (body == BODY_TIBIA)
        return joint_to_pose(&knee->joint, joint);
    return body == BODY_PATELLA ? case_patella_pose(knee, joint->flexion_deg) : pose_identity();
}
