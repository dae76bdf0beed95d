#include "rehearsal/take.h"

#include <stdio.h>

static struct motion_step *add(struct motion_script *script, enum motion_verb verb,
                               enum channel tool, const char *name) {
    if (script->step_count == MOTION_STEPS_MAX)
        return NULL;
    struct motion_step *step = &script->steps[script->step_count++];
    *step = (struct motion_step){.verb = verb, .tool = tool};
    snprintf(step->name, sizeof step->name, "%s", name);
    return step;
}

// Places of a motion are those of a right knee.
static void look_at(struct motion_script *script, const struct knee_case *knee,
                    const struct case_loose *loose, double distance) {
    struct motion_step *step = add(script, MOTION_LOOK, CHANNEL_SCOPE, body_name(loose->body));
    if (!step)
        return;
    step->has_place = true;
    step->amount = distance;
    step->from.at = loose->at;
    if (knee->joint.side == SIDE_LEFT)
        step->from.at.x = -step->from.at.x;
}

void take_out(struct motion_script *script, const struct knee_case *knee, uint32_t which,
              const char *portal, double distance) {
    for (int i = 0; i < knee->loose_count; i++) {
        if (!(which >> i & 1))
            continue;
        look_at(script, knee, &knee->loose[i], distance);
        add(script, MOTION_APPROACH, CHANNEL_FIRST_DESCRIBED, portal);
        add(script, MOTION_TAKE, CHANNEL_FIRST_DESCRIBED, knee->loose[i].name);
    }
}
