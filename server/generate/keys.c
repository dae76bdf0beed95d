#include "generate/keys.h"

#include "base/check.h"
#include "motion/joint.h"

#include <string.h>

static double value_at(const struct recipe_series *series, int key) {
    return series->count > 1 ? series->values[key] : series->values[0];
}

struct knee_solids {
    const struct knee_case *knee;
    struct solid femur, tibia, menisci[2];
};

static pose held(const struct knee_solids *bones, const struct joint_hold *hold) {
    struct joint_angles angles = motion_joint(bones->knee, &bones->femur, &bones->tibia, hold);
    return joint_to_pose(&bones->knee->joint, &angles);
}

static struct case_key key_of(const struct knee_solids *bones, const struct recipe_ligament *l,
                              int key) {
    struct joint_hold hold = {.flexion_deg = value_at(&l->flexion_deg, key),
                              .valgus_deg = value_at(&l->valgus_deg, key),
                              .internal_deg = value_at(&l->internal_deg, key),
                              .drawer_mm = value_at(&l->drawer_mm, key)};
    pose physical = held(bones, &hold);
    hold.valgus_deg += value_at(&l->extra_valgus_deg, key);
    hold.internal_deg += value_at(&l->extra_internal_deg, key);
    hold.drawer_mm += value_at(&l->extra_drawer_mm, key);
    pose target = held(bones, &hold);
    for (int i = 0; i < 2; i++)
        target = motion_clear(bones->knee, bones->femur.mesh, &bones->menisci[i], physical, target);
    return (struct case_key){.physical = physical, .target = target};
}

static void add_ligament(struct knee_case *knee, const struct knee_solids *bones,
                         const struct recipe_ligament *ligament) {
    CHECK(knee->torn_count < CASE_LIGAMENTS_MAX);
    strcpy(knee->torn[knee->torn_count], ligament->name);
    for (int i = 0; i < ligament->flexion_deg.count; i++) {
        CHECK(knee->key_count < CASE_KEYS_MAX);
        struct case_key *key = &knee->keys[knee->key_count++];
        *key = key_of(bones, ligament, i);
        key->ligament = knee->torn_count;
    }
    knee->torn_count++;
}

enum result generate_keys(struct knee_case *knee, const struct recipe *recipe, struct error *err) {
    struct knee_solids bones = {.knee = knee};
    enum result result = solid_init(&bones.femur, &case_group(knee, "femur")->mesh, err);
    if (result == RESULT_OK)
        result = solid_init(&bones.tibia, &case_group(knee, "tibia")->mesh, err);
    if (result == RESULT_OK)
        result = solid_init(&bones.menisci[0], &case_group(knee, "meniscus_medial")->mesh, err);
    if (result == RESULT_OK)
        result = solid_init(&bones.menisci[1], &case_group(knee, "meniscus_lateral")->mesh, err);
    for (int i = 0; i < recipe->ligament_count && result == RESULT_OK; i++)
        add_ligament(knee, &bones, &recipe->ligaments[i]);
    solid_fini(&bones.femur);
    solid_fini(&bones.tibia);
    solid_fini(&bones.menisci[0]);
    solid_fini(&bones.menisci[1]);
    return result;
}
