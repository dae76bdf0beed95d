#include "generate/keys.h"

#include "motion/joint.h"

#include <string.h>

static double value_at(const struct pathology_values *series, int key) {
    return series->count > 1 ? series->values[key] : series->values[0];
}

struct knee_solids {
    const struct knee_case *knee;
    struct solid femur, tibia;
    int meniscus_count;
    struct solid menisci[2];
};

static pose held(const struct knee_solids *bones, const struct joint_hold *hold) {
    struct joint_angles angles = motion_joint(bones->knee, &bones->femur, &bones->tibia, hold);
    return joint_to_pose(&bones->knee->joint, &angles);
}

static struct case_key key_of(const struct knee_solids *bones, const struct pathology_ligament *l,
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
    for (int i = 0; i < bones->meniscus_count; i++)
        target = motion_clear(bones->knee, bones->femur.mesh, &bones->menisci[i], physical, target);
    return (struct case_key){.physical = physical, .target = target};
}

static enum result check_room(const struct knee_case *knee, const char *name,
                              const struct pathology_ligament *ligament, struct error *err) {
    for (int i = 0; i < knee->torn_count; i++)
        if (strcmp(knee->torn[i], name) == 0)
            return fail(err, RESULT_INVALID, "%s is torn already", name);
    if (knee->torn_count == CASE_LIGAMENTS_MAX)
        return fail(err, RESULT_LIMIT, "%d ligaments are torn already", CASE_LIGAMENTS_MAX);
    if (knee->key_count + ligament->flexion_deg.count > CASE_KEYS_MAX)
        return fail(err, RESULT_LIMIT, "%d keys of all ligaments, more than %d",
                    knee->key_count + ligament->flexion_deg.count, CASE_KEYS_MAX);
    return RESULT_OK;
}

static enum result need(struct knee_case *knee, const char *name, struct solid *out_solid,
                        struct error *err) {
    const struct case_group *group = case_group(knee, name);
    if (!group)
        return fail(err, RESULT_MISSING, "the case has no group %s", name);
    return solid_init(out_solid, &group->mesh, err);
}

static enum result take_solids(struct knee_solids *bones, struct knee_case *knee,
                               struct error *err) {
    static const char *const menisci[] = {"meniscus_medial", "meniscus_lateral"};
    enum result result = need(knee, "femur", &bones->femur, err);
    if (result == RESULT_OK)
        result = need(knee, "tibia", &bones->tibia, err);
    for (int i = 0; i < 2 && result == RESULT_OK; i++)
        if (case_group(knee, menisci[i]))
            result = need(knee, menisci[i], &bones->menisci[bones->meniscus_count++], err);
    return result;
}

enum result keys_add(struct knee_case *knee, const char *name,
                     const struct pathology_ligament *ligament, struct error *err) {
    struct knee_solids bones = {.knee = knee};
    enum result result = check_room(knee, name, ligament, err);
    if (result != RESULT_OK)
        return result;
    result = take_solids(&bones, knee, err);
    if (result == RESULT_OK) {
        for (int i = 0; i < ligament->flexion_deg.count; i++) {
            struct case_key *key = &knee->keys[knee->key_count++];
            *key = key_of(&bones, ligament, i);
            key->ligament = knee->torn_count;
        }
        strcpy(knee->torn[knee->torn_count++], name);
    }
    solid_fini(&bones.femur);
    solid_fini(&bones.tibia);
    solid_fini(&bones.menisci[0]);
    solid_fini(&bones.menisci[1]);
    return result;
}
