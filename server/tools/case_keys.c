#include "case_keys.h"

#include <stdio.h>
#include <string.h>

#define SHOWN 0.05 // of degrees and mm

static void add_text(char text[KEY_TEXT_MAX], double value, const char *more, const char *less,
                     const char *unit) {
    size_t used = strlen(text);
    if (fabs(value) >= SHOWN)
        snprintf(text + used, KEY_TEXT_MAX - used, "%s%s %.1f %s", used ? ", " : "",
                 value > 0 ? more : less, fabs(value), unit);
}

void key_motion_text(const struct joint_frame *joint, pose from, pose to, char out[KEY_TEXT_MAX]) {
    struct joint_angles a = joint_from_pose(joint, from), b = joint_from_pose(joint, to);
    out[0] = '\0';
    add_text(out, b.flexion_deg - a.flexion_deg, "flexion", "extension", "deg");
    add_text(out, b.varus_deg - a.varus_deg, "varus", "valgus", "deg");
    add_text(out, b.internal_deg - a.internal_deg, "internal", "external", "deg");
    add_text(out, b.drawer_mm - a.drawer_mm, "drawer", "posterior drawer", "mm");
    add_text(out, b.shift_mm - a.shift_mm, "lateral", "medial", "mm");
    add_text(out, b.distraction_mm - a.distraction_mm, "distraction", "compression", "mm");
    if (!out[0])
        snprintf(out, KEY_TEXT_MAX, "nothing");
}

static pose unopened(const struct joint_frame *joint, double flexion_deg) {
    return joint_to_pose(joint, &(struct joint_angles){.flexion_deg = flexion_deg});
}

void print_key(const struct knee_case *knee, int index) {
    const struct case_key *key = &knee->keys[index];
    double flexion = joint_from_pose(&knee->joint, key->physical).flexion_deg;
    char held[KEY_TEXT_MAX], extra[KEY_TEXT_MAX];
    key_motion_text(&knee->joint, unopened(&knee->joint, flexion), key->physical, held);
    key_motion_text(&knee->joint, key->physical, key->target, extra);
    printf("torn %-10s at %.1f deg of flexion: held at %s; goes on by %s\n",
           knee->torn[key->ligament], flexion, held, extra);
}

static json_t *angles_object(const struct joint_angles *a) {
    return json_pack("{s:f, s:f, s:f, s:f, s:f, s:f}", "flexion_deg", a->flexion_deg, "varus_deg",
                     a->varus_deg, "internal_deg", a->internal_deg, "shift_mm", a->shift_mm,
                     "drawer_mm", a->drawer_mm, "distraction_mm", a->distraction_mm);
}

json_t *keys_array(const struct knee_case *knee) {
    json_t *array = json_array();
    for (int i = 0; i < knee->torn_count; i++) {
        json_t *keys = json_array();
        for (int k = 0; k < knee->key_count; k++) {
            if (knee->keys[k].ligament != i)
                continue;
            struct joint_angles a = joint_from_pose(&knee->joint, knee->keys[k].physical);
            struct joint_angles b = joint_from_pose(&knee->joint, knee->keys[k].target);
            json_array_append_new(keys, json_pack("{s:o, s:o}", "physical", angles_object(&a),
                                                  "target", angles_object(&b)));
        }
        json_array_append_new(array,
                              json_pack("{s:s, s:o}", "ligament", knee->torn[i], "keys", keys));
    }
    return array;
}
