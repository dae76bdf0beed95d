#include "base/turn.h"

static const int pairs[3][2] = {{0, 0}, {0, 1}, {1, 1}};

// g = c − 1 + 1/(1 + c)
struct turn turn_into(vec3 u, const vec3 e[2], const double v[2]) {
    struct turn t;
    for (int j = 0; j < 2; j++)
        t.axes[j] = vec3_cross(u, e[j]);
    t.k = vec3_add_scaled(vec3_scale(v[0], t.axes[0]), v[1], t.axes[1]);
    t.c = 1 / sqrt(1 + v[0] * v[0] + v[1] * v[1]);
    t.g = t.c * t.c / (1 + t.c);
    double c3 = t.c * t.c * t.c, over = 1 / (1 + t.c);
    double slope = 1 - over * over, bend = 2 * over * over * over;
    for (int j = 0; j < 2; j++) {
        t.c1[j] = -c3 * v[j];
        t.g1[j] = slope * t.c1[j];
    }
    for (int p = 0; p < 3; p++) {
        int i = pairs[p][0], j = pairs[p][1];
        t.c2[p] = 3 * c3 * t.c * t.c * v[i] * v[j] - (i == j ? c3 : 0);
        t.g2[p] = bend * t.c1[i] * t.c1[j] + slope * t.c2[p];
    }
    return t;
}

vec3 turn_apply(const struct turn *t, vec3 x) {
    vec3 a = vec3_cross(t->k, x);
    return vec3_add_scaled(vec3_add_scaled(x, t->c, a), t->g, vec3_cross(t->k, a));
}

// Half the angle: cos² = (1 + c)/2, and |k| c is the whole angle's sine.
quat turn_rotation(const struct turn *t) {
    double half = sqrt((1 + t->c) / 2), scale = t->c / (2 * half);
    return (quat){half, scale * t->k.x, scale * t->k.y, scale * t->k.z};
}

void turn_slopes(const struct turn *t, vec3 x, vec3 out_first[2], vec3 out_second[3]) {
    vec3 a = vec3_cross(t->k, x), b = vec3_cross(t->k, a), a1[2], b1[2];
    for (int j = 0; j < 2; j++) {
        a1[j] = vec3_cross(t->axes[j], x);
        b1[j] = vec3_add(vec3_cross(t->axes[j], a), vec3_cross(t->k, a1[j]));
        vec3 first = vec3_add_scaled(vec3_scale(t->c1[j], a), t->c, a1[j]);
        out_first[j] = vec3_add_scaled(vec3_add_scaled(first, t->g1[j], b), t->g, b1[j]);
    }
    for (int p = 0; p < 3; p++) {
        int i = pairs[p][0], j = pairs[p][1];
        vec3 b2 = vec3_add(vec3_cross(t->axes[i], a1[j]), vec3_cross(t->axes[j], a1[i]));
        vec3 sum = vec3_add_scaled(vec3_scale(t->c2[p], a), t->g2[p], b);
        sum = vec3_add_scaled(vec3_add_scaled(sum, t->c1[i], a1[j]), t->c1[j], a1[i]);
        sum = vec3_add_scaled(vec3_add_scaled(sum, t->g1[i], b1[j]), t->g1[j], b1[i]);
        out_second[p] = vec3_add_scaled(sum, t->g, b2);
    }
}
