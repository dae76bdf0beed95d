#include "trace/remark.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define REACH_MM 10000

static bool is_near(vec3 p) {
    return fabs(p.x) <= REACH_MM && fabs(p.y) <= REACH_MM && fabs(p.z) <= REACH_MM;
}

bool remark_is_valid(const struct remark *r) {
    return r->number >= 1 && r->number <= REMARKS_MAX && memchr(r->text, 0, sizeof r->text) &&
           memchr(r->author, 0, sizeof r->author) && (unsigned)r->body < BODY_COUNT &&
           is_near(r->point) && (r->has_marker || r->withdrawn || r->text[0]);
}

void remark_describe(const struct remark *r, char out_text[REMARK_DESCRIPTION_SIZE]) {
    if (r->has_marker)
        snprintf(out_text, REMARK_DESCRIPTION_SIZE, "%s [touch %.1f %.1f %.1f mm of the %s]",
                 r->text, r->point.x, r->point.y, r->point.z, body_name(r->body));
    else
        snprintf(out_text, REMARK_DESCRIPTION_SIZE, "%s%s", r->text,
                 r->withdrawn ? " [withdrawn]" : "");
}
