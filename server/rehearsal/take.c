#include "rehearsal/take.h"

#include "rehearsal/planner.h"

// Places of a motion are those of a right knee.
static void look_at(struct motion_script *script, const struct knee_case *knee,
                    const struct case_loose *loose, double distance) {
    struct motion_step *step =
        add_named(script, MOTION_LOOK, CHANNEL_SCOPE, body_name(loose->body));
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
        add_named(script, MOTION_APPROACH, CHANNEL_FIRST_DESCRIBED, portal);
        add_named(script, MOTION_TAKE, CHANNEL_FIRST_DESCRIBED, knee->loose[i].name);
    }
}
