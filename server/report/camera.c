#include "report/camera.h"

#define MARGIN 1.04

// An eye at k heights shows a point (x, y, z) of the camera's frame within the height h where
// |y| k h / (k h - z) <= h / 2, that is 2 |y| + z / k <= h.
static double height_for(vec3 p, double aspect, double heights) {
    return 2 * fmax(fabs(p.y), fabs(p.x) / aspect) + p.z / heights;
}

struct camera camera_fit(const struct box *box, vec3 from, vec3 up, double aspect, double heights) {
    vec3 z = vec3_unit_or(from, (vec3){0, 0, 1});
    vec3 x = vec3_unit_or(vec3_cross(up, z), (vec3){1, 0, 0}), y = vec3_cross(z, x);
    mat3 axes = {{{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}}};
    vec3 middle = vec3_lerp(box->min, box->max, 0.5);
    double height = 0;
    for (int i = 0; i < 8; i++) {
        vec3 corner = {i & 1 ? box->max.x : box->min.x, i & 2 ? box->max.y : box->min.y,
                       i & 4 ? box->max.z : box->min.z};
        vec3 p = mat3_apply_transposed(axes, vec3_sub(corner, middle));
        height = fmax(height, height_for(p, aspect, heights));
    }
    return (struct camera){
        {quat_from_mat3(axes), middle}, MARGIN * height, MARGIN * heights * height};
}

struct ray camera_ray(const struct camera *camera, double x, double y, double reach_mm) {
    vec3 place = {x * camera->height_mm, y * camera->height_mm, 0};
    vec3 origin = {place.x, place.y, reach_mm}, direction = {0, 0, -1};
    if (isfinite(camera->distance_mm)) {
        origin = (vec3){0, 0, camera->distance_mm};
        direction = vec3_unit_or(vec3_sub(place, origin), direction);
    }
    pose T = camera->T_world_camera;
    return (struct ray){pose_apply(T, origin), quat_rotate(T.rotation, direction)};
}
