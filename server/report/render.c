#include "report/render.h"

#include "base/check.h"
#include "report/normals.h"

#include <embree3/rtcore.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#define SAMPLES 2   // a pixel, across and down
#define SKY_RAYS 32 // a pixel
#define SKY_REACH 0.25
#define LAYERS_MAX 16 // of translucent surfaces, one behind the other

// ---- what is shown ----

struct rendered_surface {
    const struct render_surface *surface;
    struct mesh world; // Embree has a copy
    vec3 *normals;
};

struct render_state {
    const struct render_scene *scene;
    struct rendered_surface *shown; // by Embree's id of the geometry
    RTCScene all, opaque;
    double reach_mm;    // how far from the camera's origin there is something
    double skip_mm;     // a ray that leaves a surface sees nothing nearer than this
    vec3 sky[SKY_RAYS]; // about z
};

static RTCDevice device;
static pthread_once_t device_once = PTHREAD_ONCE_INIT;

// One for the process, never released: Embree keeps caches of threads that outlive any owner.
static void make_device(void) {
    device = rtcNewDevice("threads=1");
}

static void shown_init(struct rendered_surface *shown, const struct render_surface *surface) {
    shown->surface = surface;
    mesh_copy(&shown->world, surface->mesh);
    for (uint32_t v = 0; v < shown->world.vertex_count; v++)
        mesh_set_vertex(&shown->world, v,
                        pose_apply(surface->T_world_mesh, mesh_vertex(surface->mesh, v)));
    shown->normals = corner_normals(&shown->world, surface->crease_deg);
}

static void attach(struct render_state *stage, unsigned id) {
    const struct rendered_surface *shown = &stage->shown[id];
    const struct mesh *mesh = &shown->world;
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    float *positions = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0,
                                               RTC_FORMAT_FLOAT3, 12, mesh->vertex_count);
    uint32_t *triangles = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0,
                                                  RTC_FORMAT_UINT3, 12, mesh->triangle_count);
    memcpy(positions, mesh->positions, 12 * (size_t)mesh->vertex_count);
    memcpy(triangles, mesh->triangles, 12 * (size_t)mesh->triangle_count);
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(stage->all, geometry, id);
    if (shown->surface->opacity >= 1)
        rtcAttachGeometryByID(stage->opaque, geometry, id);
    rtcReleaseGeometry(geometry);
}

// Above a sunflower on the disc: as dense as the cosine.
static void make_sky(vec3 out_sky[SKY_RAYS]) {
    const double golden_rad = 2 * M_PI * 0.61803398874989485;
    for (int i = 0; i < SKY_RAYS; i++) {
        double square = (i + 0.5) / SKY_RAYS, radius = sqrt(square);
        out_sky[i] =
            (vec3){radius * cos(i * golden_rad), radius * sin(i * golden_rad), sqrt(1 - square)};
    }
}

static void stage_init(struct render_state *stage, const struct render_scene *scene) {
    vec3 middle = scene->camera.T_world_camera.translation;
    *stage = (struct render_state){.scene = scene, .all = rtcNewScene(device)};
    stage->opaque = rtcNewScene(device);
    stage->shown = alloc((size_t)scene->surface_count, sizeof *stage->shown);
    rtcSetSceneFlags(stage->all, RTC_SCENE_FLAG_ROBUST);
    for (int i = 0; i < scene->surface_count; i++) {
        struct rendered_surface *shown = &stage->shown[i];
        shown_init(shown, &scene->surfaces[i]);
        for (uint32_t v = 0; v < shown->world.vertex_count; v++)
            stage->reach_mm =
                fmax(stage->reach_mm, vec3_distance(mesh_vertex(&shown->world, v), middle));
        if (shown->world.triangle_count)
            attach(stage, (unsigned)i);
    }
    rtcCommitScene(stage->all);
    rtcCommitScene(stage->opaque);
    make_sky(stage->sky);
    stage->skip_mm = 1e-4 * scene->camera.height_mm + 1e-6 * stage->reach_mm;
}

static void stage_fini(struct render_state *stage) {
    for (int i = 0; i < stage->scene->surface_count; i++) {
        mesh_fini(&stage->shown[i].world);
        free(stage->shown[i].normals);
    }
    free(stage->shown);
    rtcReleaseScene(stage->all);
    rtcReleaseScene(stage->opaque);
}

// ---- light: linear, red, green and blue as a vector ----

static double to_linear(double s) {
    return s <= 0.04045 ? s / 12.92 : pow((s + 0.055) / 1.055, 2.4);
}

static double to_srgb(double linear) {
    return linear <= 0.0031308 ? 12.92 * linear : 1.055 * pow(linear, 1 / 2.4) - 0.055;
}

static vec3 light_of(struct colour c) {
    return (vec3){to_linear(c.r), to_linear(c.g), to_linear(c.b)};
}

static uint8_t byte_of(double linear) {
    return (uint8_t)lround(255 * to_srgb(fmin(fmax(linear, 0), 1)));
}

// ---- one ray ----

struct hit {
    const struct rendered_surface *shown;
    struct render_spot spot; // its point in the world
    vec3 face, normal;       // unit length, towards the viewer
    double distance;
};

static struct RTCRay embree_ray(vec3 origin, vec3 direction, double near, double far) {
    return (struct RTCRay){
        .org_x = (float)origin.x,
        .org_y = (float)origin.y,
        .org_z = (float)origin.z,
        .dir_x = (float)direction.x,
        .dir_y = (float)direction.y,
        .dir_z = (float)direction.z,
        .tnear = (float)near,
        .tfar = (float)far,
        .mask = UINT32_MAX,
    };
}

static vec3 blend(const double weights[3], vec3 a, vec3 b, vec3 c) {
    return vec3_add_scaled(vec3_add_scaled(vec3_scale(weights[0], a), weights[1], b), weights[2],
                           c);
}

static bool cast(const struct render_state *stage, const struct ray *ray, double near,
                 struct hit *out) {
    struct RTCIntersectContext context;
    struct RTCRayHit found = {.ray = embree_ray(ray->origin, ray->direction, near, INFINITY),
                              .hit.geomID = RTC_INVALID_GEOMETRY_ID};
    rtcInitIntersectContext(&context);
    rtcIntersect1(stage->all, &context, &found);
    if (found.hit.geomID == RTC_INVALID_GEOMETRY_ID)
        return false;
    const struct rendered_surface *shown = &stage->shown[found.hit.geomID];
    uint32_t t = found.hit.primID;
    double u = (double)found.hit.u, v = (double)found.hit.v;
    *out = (struct hit){.shown = shown, .distance = (double)found.ray.tfar};
    out->spot = (struct render_spot){.triangle = t, .weights = {1 - u - v, u, v}};
    const struct mesh *mesh = &shown->world;
    vec3 a = mesh_corner(mesh, t, 0), b = mesh_corner(mesh, t, 1), c = mesh_corner(mesh, t, 2);
    const vec3 *n = shown->normals + 3 * (size_t)t;
    out->spot.point = blend(out->spot.weights, a, b, c);
    out->face = vec3_unit_or(vec3_cross(vec3_sub(b, a), vec3_sub(c, a)), n[0]);
    out->normal = vec3_unit_or(blend(out->spot.weights, n[0], n[1], n[2]), out->face);
    double side = vec3_dot(out->face, ray->direction) > 0 ? -1 : 1;
    out->face = vec3_scale(side, out->face);
    out->normal = vec3_scale(side, out->normal);
    return true;
}

// ---- shading ----

// Which sample of which pixel: its rays into the sky differ from those of its neighbours.
struct place {
    int sample;
    double turn; // radians
};

// Some direction at a right angle to a unit vector.
static vec3 across(vec3 n) {
    vec3 other = fabs(n.x) < 0.6 ? (vec3){1, 0, 0} : (vec3){0, 1, 0};
    return vec3_unit_or(vec3_cross(n, other), (vec3){0, 0, 1});
}

static bool is_free(const struct render_state *stage, vec3 origin, vec3 direction) {
    struct RTCIntersectContext context;
    struct RTCRay ray =
        embree_ray(origin, direction, 0, SKY_REACH * stage->scene->camera.height_mm);
    rtcInitIntersectContext(&context);
    rtcOccluded1(stage->opaque, &context, &ray);
    return ray.tfar >= 0;
}

static double sky_share(const struct render_state *stage, const struct hit *hit,
                        struct place place) {
    vec3 u = across(hit->normal), v = vec3_cross(hit->normal, u);
    vec3 x = vec3_add_scaled(vec3_scale(cos(place.turn), u), sin(place.turn), v);
    vec3 y = vec3_cross(hit->normal, x);
    vec3 origin = vec3_add_scaled(hit->spot.point, stage->skip_mm, hit->face);
    int free_count = 0;
    for (int i = place.sample; i < SKY_RAYS; i += SAMPLES * SAMPLES) {
        vec3 sky = stage->sky[i];
        vec3 d = vec3_add_scaled(vec3_scale(sky.x, x), sky.y, y);
        d = vec3_add_scaled(d, sky.z, hit->normal);
        free_count += vec3_dot(d, hit->face) <= 0 || is_free(stage, origin, d);
    }
    return (double)free_count * SAMPLES * SAMPLES / SKY_RAYS;
}

static struct colour paint_of(const struct hit *hit) {
    const struct render_surface *surface = hit->shown->surface;
    if (!surface->paint)
        return surface->colour;
    struct render_spot spot = hit->spot;
    spot.point = pose_apply_inverse(surface->T_world_mesh, spot.point);
    return surface->paint(surface->paint_context, &spot);
}

static vec3 shade(const struct render_state *stage, const struct hit *hit, struct place place) {
    quat turn = stage->scene->camera.T_world_camera.rotation;
    vec3 above = quat_rotate(turn, vec3_unit_or((vec3){-0.45, 0.6, 0.7}, (vec3){0}));
    vec3 right = quat_rotate(turn, vec3_unit_or((vec3){0.8, -0.1, 0.5}, (vec3){0}));
    double light = 0.45 * sky_share(stage, hit, place) +
                   0.62 * fmax(0, vec3_dot(hit->normal, above)) +
                   0.16 * fmax(0, vec3_dot(hit->normal, right));
    return vec3_scale(light, light_of(paint_of(hit)));
}

static vec3 light_along(const struct render_state *stage, const struct ray *ray,
                        struct place place) {
    vec3 sum = {0};
    double through = 1, near = 0;
    struct hit hit;
    for (int i = 0; i < LAYERS_MAX && cast(stage, ray, near, &hit); i++) {
        double opacity = hit.shown->surface->opacity;
        sum = vec3_add_scaled(sum, through * opacity, shade(stage, &hit, place));
        if (opacity >= 1)
            return sum;
        through *= 1 - opacity;
        near = hit.distance + stage->skip_mm;
    }
    return vec3_add_scaled(sum, through, light_of(stage->scene->background));
}

// ---- the picture ----

static double fraction(double x) {
    return x - floor(x);
}

static void render_pixel(const struct render_state *stage, int column, int row,
                         struct picture *picture) {
    const struct camera *camera = &stage->scene->camera;
    // Jimenez's interleaved gradient noise: even over each few pixels
    double turn =
        2 * M_PI * fraction(52.9829189 * fraction(0.06711056 * column + 0.00583715 * row));
    vec3 sum = {0};
    for (int i = 0; i < SAMPLES * SAMPLES; i++) {
        double across_px = column + (i % SAMPLES + 0.5) / SAMPLES;
        double down_px = row + (i / SAMPLES + 0.5) / SAMPLES;
        struct ray ray = camera_ray(camera, (across_px - 0.5 * picture->width) / picture->height,
                                    0.5 - down_px / picture->height, stage->reach_mm);
        sum = vec3_add(sum, light_along(stage, &ray, (struct place){i, turn}));
    }
    uint8_t *rgb = picture->rgb + 3 * ((size_t)row * (size_t)picture->width + (size_t)column);
    vec3 mean = vec3_scale(1.0 / (SAMPLES * SAMPLES), sum);
    rgb[0] = byte_of(mean.x);
    rgb[1] = byte_of(mean.y);
    rgb[2] = byte_of(mean.z);
}

enum result render(const struct render_scene *scene, int width, int height,
                   struct picture *out_picture, struct error *err) {
    pthread_once(&device_once, make_device);
    if (!device)
        return fail(err, RESULT_IO, "Embree cannot start: error %d", rtcGetDeviceError(NULL));
    struct render_state stage;
    stage_init(&stage, scene);
    enum RTCError problem = rtcGetDeviceError(device);
    if (problem == RTC_ERROR_NONE) {
        picture_init(out_picture, width, height);
        for (int row = 0; row < height; row++)
            for (int column = 0; column < width; column++)
                render_pixel(&stage, column, row, out_picture);
    }
    stage_fini(&stage);
    if (problem != RTC_ERROR_NONE)
        return fail(err, RESULT_IO, "Embree cannot build a picture's scene: error %d", problem);
    return RESULT_OK;
}
