#include "step/settings.h"

#include "base/clock.h"

#define SHAFT_POINTS 8
#define SHAFT_SPACING_MM 7.0
#define POINT_AWAY_MAX_MM 300
#define RADIUS_MAX_MM 20

bool instrument_body_is_valid(const struct instrument_body *body) {
    if (body->point_count < 1 || body->point_count > AVATAR_POINTS_MAX)
        return false;
    for (int i = 0; i < body->point_count; i++) {
        const struct avatar_point *p = &body->points[i];
        double away = vec3_length(p->at); // NaN is in no range
        if (!(away <= POINT_AWAY_MAX_MM) || !(p->radius_mm >= 0 && p->radius_mm <= RADIUS_MAX_MM))
            return false;
    }
    return vec3_length(body->points[0].at) == 0;
}

struct session_settings session_settings_default(void) {
    struct field field = field_default(FIELD_INTEGRAL);
    field.skin_mm = 0.1;
    struct session_settings settings = {
        .rules = RULES_NEWEST,
        .field = field,
        .adaptive = ADAPTIVE_HINGE,
        .avatar = AVATAR_TIP,
        .instruments = *instruments_usual(),
        .hold_ns = 100 * NS_PER_MS,
        .ease_share = 0.2,
        .ease_mm_s = 2,
    };
    for (int i = 0; i < INSTRUMENT_COUNT; i++) {
        struct instrument_body *body = &settings.bodies[i];
        body->point_count = SHAFT_POINTS;
        for (int k = 0; k < SHAFT_POINTS; k++)
            body->points[k].at.z = -SHAFT_SPACING_MM * k;
    }
    return settings;
}

enum adaptive_ramp settings_ramp(const struct session_settings *settings) {
    return settings->rules >= RULES_WITH_STRAIGHT_RAMP ? ADAPTIVE_RAMP_STRAIGHT
                                                       : ADAPTIVE_RAMP_CUBIC;
}

const char *settings_digits(const struct session_settings *settings) {
    return settings->field.kind == FIELD_INTEGRAL && settings->rules < RULES_OTHER_ORDER
               ? "since rules 10 the integral field adds up the same sums in another order, so its "
                 "last digits are others"
               : NULL;
}
