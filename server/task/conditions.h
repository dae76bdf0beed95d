// The conditions of goals and errors at one step. For attempt.c only.
#pragma once

#include "task/attempt.h"

// What the trainee looks through: the first optic that is there.
struct looking {
    bool is_there;
    int tool;            // of the session's instruments
    pose T_mockup_scope; // as it is shown
    vec3 axis;           // where it looks, a unit vector
    double half_field_deg;
};

struct looking looking_at(const struct site *site, const struct session_output *output);

// False where all points of its landmark are clearly beside the picture, too far or too near. It is
// cheap: asked first, it answers for most goals at most steps.
bool goal_may_be_seen(const struct goal *goal, const struct site *site, int index,
                      const struct session_output *output, const struct looking *looking);
// Of one that may be.
bool goal_is_seen(const struct goal *goal, const struct site *site, int index,
                  const struct session_output *output, const struct looking *looking,
                  struct attempt *attempt);
bool goal_touches(const struct goal *goal, const struct site *site, int index,
                  const struct session_output *output, const struct looking *looking);
bool goal_is_through(const struct site *site, int index, const struct session_output *output,
                     const struct looking *looking); // the portals that it names
bool goal_holds_joint(const struct goal *goal, const struct site *site,
                      const struct session_output *output);
bool goal_took_out(const struct goal *goal, const struct site_goal *g,
                   const struct session_output *output);
bool goal_resected(const struct goal *goal, const struct site_goal *g,
                   const struct attempt *attempt);

// How many points of the line the tip has passed, `along` before this step.
int32_t goal_goes_along(const struct goal *goal, const struct site_goal *g,
                        const struct session_output *output, int32_t along);

// Whether it counts for each tool, or once for the knee as it is (over_share, dropped).
bool error_is_of_tool(const struct site *site, int error);
// Of one that was counted: whether it goes on.
bool error_holds(const struct site *site, int error, int tool, const struct session_output *output,
                 const struct looking *looking, const struct attempt *attempt,
                 struct error_state *state);
