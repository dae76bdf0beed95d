#include "base/check.h"
#include "folder.h"
#include "mesh/topology.h"
#include "report/normals.h"
#include "report/render.h"
#include "report/rods.h"
#include "scene/shapes.h"
#include "test.h"

#include <png.h>
#include <stdlib.h>
#include <string.h>

#define SIDE 120  // pixels
#define HIGH 60.0 // mm: two pixels each

static const struct colour white = {1, 1, 1}, blue = {0.2, 0.4, 0.9};

// Parallel, from +z, y up: pixel (column, row) is at x = (column + 0.5 - SIDE / 2) / 2.
static struct camera from_above(void) {
    struct box box = {{-HIGH / 2, -HIGH / 2, -1}, {HIGH / 2, HIGH / 2, 1}};
    struct camera camera = camera_fit(&box, (vec3){0, 0, 1}, (vec3){0, 1, 0}, 1, INFINITY);
    camera.height_mm = HIGH;
    return camera;
}

static struct render_surface surface_of(const struct mesh *mesh, vec3 at, double crease_deg) {
    return (struct render_surface){.mesh = mesh,
                                   .T_world_mesh = {quat_identity(), at},
                                   .crease_deg = crease_deg,
                                   .opacity = 1,
                                   .colour = blue};
}

static struct picture draw(const struct render_surface *surfaces, int count,
                           const struct camera *camera) {
    struct render_scene scene = {surfaces, count, *camera, white};
    struct picture picture;
    struct error err;
    assert_int_equal(render(&scene, SIDE, SIDE, &picture, &err), RESULT_OK);
    return picture;
}

static const uint8_t *pixel(const struct picture *picture, int column, int row) {
    return picture->rgb + 3 * (row * picture->width + column);
}

static bool is_white(const uint8_t *rgb) {
    return rgb[0] == 255 && rgb[1] == 255 && rgb[2] == 255;
}

static double middle_mm(int index) {
    return (index + 0.5 - SIDE / 2) * HIGH / SIDE;
}

// ---- the shading's equation, again ----

static double linear(double s) {
    return s > 0.04045 ? pow((s + 0.055) / 1.055, 2.4) : s / 12.92;
}

static double byte_of(double light) {
    double s = light > 0.0031308 ? 1.055 * pow(light, 1 / 2.4) - 0.055 : 12.92 * light;
    return 255 * fmin(s, 1);
}

static double light_on(vec3 normal, double open) {
    vec3 a = vec3_unit_or((vec3){-0.45, 0.6, 0.7}, (vec3){0});
    vec3 b = vec3_unit_or((vec3){0.8, -0.1, 0.5}, (vec3){0});
    return 0.45 * open + 0.62 * fmax(0, vec3_dot(normal, a)) + 0.16 * fmax(0, vec3_dot(normal, b));
}

static void assert_shade(const uint8_t *rgb, double light, double tolerance) {
    assert_near(rgb[0], byte_of(light * linear(blue.r)), tolerance);
    assert_near(rgb[1], byte_of(light * linear(blue.g)), tolerance);
    assert_near(rgb[2], byte_of(light * linear(blue.b)), tolerance);
}

// ---- rendering ----

static void a_sphere_is_a_disc_lit_as_its_normals_say(void **state) {
    (void)state;
    const double radius = 20;
    struct mesh mesh;
    shape_sphere(&mesh, radius, 60);
    struct render_surface surface = surface_of(&mesh, (vec3){4, -6, 100}, 60);
    struct camera camera = from_above();
    struct picture picture = draw(&surface, 1, &camera);
    int inside = 0;
    for (int row = 0; row < SIDE; row++)
        for (int column = 0; column < SIDE; column++) {
            double x = middle_mm(column) - 4, y = -middle_mm(row) + 6, r = hypot(x, y);
            const uint8_t *rgb = pixel(&picture, column, row);
            if (r > radius + 0.4)
                assert_true(is_white(rgb));
            else if (r < radius - 0.4)
                assert_false(is_white(rgb));
            if (r > 0.95 * radius)
                continue;
            vec3 normal = {x / radius, y / radius, sqrt(1 - r * r / radius / radius)};
            assert_shade(rgb, light_on(normal, 1), 2.5);
            inside++;
        }
    assert_true(inside > 4000);
    picture_fini(&picture);
    mesh_fini(&mesh);
}

static void pixels_on_an_edge_are_blended_in_linear_light(void **state) {
    (void)state;
    struct mesh mesh;
    shape_box(&mesh, (vec3){9.875, 10, 1});
    // 20 mm less a quarter: half of column 79 is left out
    struct render_surface surface = surface_of(&mesh, (vec3){-0.125, 0, 0}, 30);
    struct camera camera = from_above();
    struct picture picture = draw(&surface, 1, &camera);
    double light = light_on((vec3){0, 0, 1}, 1);
    for (int row = 0; row < SIDE; row++)
        for (int column = 0; column < SIDE; column++) {
            const uint8_t *rgb = pixel(&picture, column, row);
            bool within = column >= 40 && column < 80 && row >= 40 && row < 80;
            if (within && column == 79)
                assert_near(rgb[0], byte_of((1 + light * linear(blue.r)) / 2), 0.51);
            else if (within)
                assert_shade(rgb, light, 0.51);
            else
                assert_true(is_white(rgb));
        }
    picture_fini(&picture);
    mesh_fini(&mesh);
}

static void the_nearest_surface_is_seen_and_a_translucent_one_seen_through(void **state) {
    (void)state;
    struct mesh mesh;
    shape_box(&mesh, (vec3){10, 10, 1});
    struct render_surface surfaces[3] = {surface_of(&mesh, (vec3){0, 0, 0}, 30),
                                         surface_of(&mesh, (vec3){0, 0, 20}, 30),
                                         surface_of(&mesh, (vec3){0, 0, -20}, 30)};
    surfaces[1].colour = white;
    surfaces[1].opacity = 0.25;
    surfaces[2].colour = (struct colour){1, 0, 0};
    struct camera camera = from_above();
    struct picture picture = draw(surfaces, 3, &camera);
    double light = light_on((vec3){0, 0, 1}, 1);
    // the upper and the lower side of the translucent box, then the box behind it; two of the
    // sides face the viewer
    double veil = light * (0.25 + 0.75 * 0.25);
    assert_near(pixel(&picture, 60, 60)[0], byte_of(veil + 0.5625 * light * linear(blue.r)), 0.6);
    assert_near(pixel(&picture, 60, 60)[1], byte_of(veil + 0.5625 * light * linear(blue.g)), 0.6);
    picture_fini(&picture);
    mesh_fini(&mesh);
}

// The mean light on a column of the picture, over that of the surface's colour.
static double light_in(const struct picture *picture, int column) {
    double sum = 0;
    for (int row = 0; row < SIDE; row++)
        sum += linear(pixel(picture, column, row)[2] / 255.0);
    return sum / SIDE / linear(blue.b);
}

// A wall as high as h and without end takes (1 - d / sqrt(d² + h²)) / 2 of the sky at a distance d.
static void a_wall_darkens_its_foot(void **state) {
    (void)state;
    struct mesh floor, wall;
    shape_box(&floor, (vec3){200, 200, 1});
    shape_box(&wall, (vec3){1, 200, 200});
    struct render_surface surfaces[2] = {surface_of(&floor, (vec3){0, 0, -1}, 30),
                                         surface_of(&wall, (vec3){-1, 0, 200}, 30)};
    struct camera camera = from_above();
    struct picture picture = draw(surfaces, 2, &camera);
    vec3 up = {0, 0, 1};
    assert_near(light_in(&picture, 60), light_on(up, 0.5), 0.02);
    assert_near(light_in(&picture, 110), light_on(up, 1), 0.01); // 25 mm off, out of reach
    picture_fini(&picture);
    surfaces[1].T_world_mesh.translation.z = -197;
    picture = draw(surfaces, 2, &camera);
    assert_near(light_in(&picture, 62), light_on(up, 1 - 0.5 * (1 - 1.25 / 3.25)), 0.01);
    picture_fini(&picture);
    surfaces[1].opacity = 0.5;
    picture = draw(surfaces, 2, &camera);
    assert_shade(pixel(&picture, 61, 30), light_on(up, 1), 0.6);
    picture_fini(&picture);
    mesh_fini(&floor);
    mesh_fini(&wall);
}

static int width_of(const struct picture *picture, int row) {
    int count = 0;
    for (int column = 0; column < SIDE; column++)
        count += !is_white(pixel(picture, column, row));
    return count;
}

static void perspective_keeps_sizes_at_the_origin_and_shrinks_what_is_behind(void **state) {
    (void)state;
    struct mesh mesh;
    shape_box(&mesh, (vec3){10, 10, 0.001});
    struct camera camera = from_above();
    camera.distance_mm = 100;
    const double z[] = {0, -100, 50};
    const int expected[] = {40, 20, 80};
    for (int i = 0; i < 3; i++) {
        struct render_surface surface = surface_of(&mesh, (vec3){0, 0, z[i]}, 30);
        struct picture picture = draw(&surface, 1, &camera);
        assert_in_range(width_of(&picture, 60), expected[i], expected[i] + 1);
        picture_fini(&picture);
    }
    mesh_fini(&mesh);
}

struct watched {
    const struct render_surface *surface;
    int calls;
};

// Samples lie an eighth of a millimetre and then each quarter.
static double off_samples(double mm) {
    return remainder(mm - 0.125, 0.25);
}

static struct colour watch(const void *context, const struct render_spot *spot) {
    struct watched *watched = *(struct watched *const *)context;
    vec3 p = {0};
    for (int i = 0; i < 3; i++)
        p = vec3_add_scaled(p, spot->weights[i],
                            mesh_corner(watched->surface->mesh, spot->triangle, i));
    assert_vec3_near(p, spot->point, 1e-4);
    vec3 seen = pose_apply(watched->surface->T_world_mesh, p);
    assert_near(off_samples(seen.x), 0, 1e-3);
    assert_near(off_samples(seen.y), 0, 1e-3);
    watched->calls++;
    return (struct colour){0, 0, 0};
}

static void paint_is_asked_in_the_frame_of_the_mesh(void **state) {
    (void)state;
    struct mesh mesh;
    shape_sphere(&mesh, 20, 40);
    struct render_surface surface = surface_of(&mesh, (vec3){5, 0, 7}, 60);
    surface.T_world_mesh.rotation = quat_from_axis_angle((vec3){0, 0.6, 0.8}, 1);
    struct watched watched = {&surface, 0}, *context = &watched;
    surface.paint = watch;
    surface.paint_context = &context;
    struct camera camera = from_above();
    struct picture picture = draw(&surface, 1, &camera);
    assert_true(watched.calls > 4 * 4000);
    assert_int_equal(pixel(&picture, 70, 60)[0], 0);
    picture_fini(&picture);
    mesh_fini(&mesh);
}

static void nothing_and_triangles_without_area_leave_the_background(void **state) {
    (void)state;
    float positions[] = {0, 0, 0, 5, 5, 0, 10, 10, 0, 0, 0, 0};
    uint32_t triangles[] = {0, 1, 2, 0, 1, 3};
    struct mesh flat = {4, 2, positions, triangles}, none;
    mesh_init(&none, 0, 0);
    struct render_surface surfaces[2] = {surface_of(&flat, (vec3){0}, 40),
                                         surface_of(&none, (vec3){0}, 40)};
    struct camera camera = from_above();
    for (int count = 0; count <= 2; count++) {
        struct picture picture = draw(surfaces, count, &camera);
        for (int i = 0; i < SIDE * SIDE; i++)
            assert_true(is_white(pixel(&picture, i % SIDE, i / SIDE)));
        picture_fini(&picture);
    }
    mesh_fini(&none);
}

static void the_same_scene_gives_the_same_bytes(void **state) {
    (void)state;
    struct mesh mesh;
    shape_bumpy(&mesh, (vec3){25, 20, 15}, 3, 30, 7);
    struct render_surface surface = surface_of(&mesh, (vec3){0}, 40);
    struct camera camera = from_above();
    struct picture a = draw(&surface, 1, &camera), b = draw(&surface, 1, &camera);
    assert_memory_equal(a.rgb, b.rgb, 3 * SIDE * SIDE);
    picture_fini(&a);
    picture_fini(&b);
    mesh_fini(&mesh);
}

// ---- its parts ----

// Of all eight corners none is outside, and one is where the margin begins.
static void a_fitted_camera_sees_the_whole_box_and_little_else(void **state) {
    (void)state;
    struct box box = {{-10, 30, 5}, {40, 50, 95}};
    const double aspect = 1.5, eyes[] = {INFINITY, 1.2, 4};
    const vec3 from[] = {{0, 0, 1}, {1, 0.2, 0.1}, {-1, -2, 0.5}};
    for (int i = 0; i < 9; i++) {
        struct camera camera =
            camera_fit(&box, from[i / 3], (vec3){0.1, 1, 0.3}, aspect, eyes[i % 3]);
        double largest = 0;
        for (int k = 0; k < 8; k++) {
            vec3 corner = {k & 1 ? 40 : -10, k & 2 ? 50 : 30, k & 4 ? 95 : 5};
            vec3 p = pose_apply_inverse(camera.T_world_camera, corner);
            double shrink =
                isinf(camera.distance_mm) ? 1 : camera.distance_mm / (camera.distance_mm - p.z);
            largest = fmax(largest, fmax(fabs(p.y), fabs(p.x) / aspect) * shrink);
        }
        assert_true(largest <= camera.height_mm / 2);
        assert_true(largest >= camera.height_mm / 2 * 0.92);
        if (isfinite(eyes[i % 3]))
            assert_near(camera.distance_mm, eyes[i % 3] * camera.height_mm, 1e-9);
        vec3 seen = pose_apply(camera.T_world_camera, (vec3){0, 0, 1});
        vec3 middle = {15, 40, 50};
        assert_vec3_near(vec3_sub(seen, middle), vec3_unit_or(from[i / 3], (vec3){0}), 1e-9);
    }
}

static void normals_are_smooth_below_the_crease_and_flat_above(void **state) {
    (void)state;
    struct mesh mesh;
    shape_box(&mesh, (vec3){3, 4, 5});
    vec3 *flat = corner_normals(&mesh, 80), *smooth = corner_normals(&mesh, 100);
    for (size_t i = 0; i < 3 * (size_t)mesh.triangle_count; i++) {
        vec3 f = flat[i], s = smooth[i], p = mesh_vertex(&mesh, mesh.triangles[i]);
        assert_near(fabs(f.x) + fabs(f.y) + fabs(f.z), 1, 1e-12); // along an axis
        assert_true(vec3_dot(f, p) > 0);
        assert_true(s.x * p.x > 0 && s.y * p.y > 0 && s.z * p.z > 0);
    }
    free(flat);
    free(smooth);
    mesh_fini(&mesh);
    shape_sphere(&mesh, 10, 30);
    smooth = corner_normals(&mesh, 40);
    for (size_t i = 0; i < 3 * (size_t)mesh.triangle_count; i++)
        assert_vec3_near(vec3_scale(10, smooth[i]), mesh_vertex(&mesh, mesh.triangles[i]), 0.1);
    free(smooth);
    mesh_fini(&mesh);
}

static void lines_become_closed_rods(void **state) {
    (void)state;
    const struct rod lines[] = {{{0, 0, 0}, {3, 4, 0}},
                                {{1, 1, 1}, {1, 1, 1}},
                                {{0, 0, 9}, {0, 0, 11}},
                                {{9, 9, 9}, {-5, 8, 7}}};
    double length = 5 + 2 + sqrt(14 * 14 + 1 + 4);
    struct mesh mesh;
    rods_mesh(lines, 4, 0.5, &mesh);
    assert_int_equal(mesh_validate(&mesh, NULL), RESULT_OK);
    struct topology t = topology_of(&mesh);
    assert_true(t.closed && t.manifold && t.oriented);
    assert_int_equal(t.components, 3);
    assert_near(mesh_volume(&mesh), 1.5 * sqrt(3) * 0.25 * length, 1e-4); // a hexagon's area
    mesh_fini(&mesh);
    rods_mesh(lines, 0, 0.5, &mesh);
    assert_int_equal(mesh.triangle_count, 0);
    mesh_fini(&mesh);
}

// ---- PNG ----

static struct picture noise(int width, int height) {
    struct picture picture;
    picture_init(&picture, width, height);
    uint32_t state = 1;
    for (int i = 0; i < 3 * width * height; i++)
        picture.rgb[i] = (uint8_t)((state = state * 1664525u + 1013904223u) >> 24);
    return picture;
}

static void a_png_holds_every_pixel(void **state) {
    (void)state;
    const int sizes[][2] = {{1, 1}, {7, 3}, {320, 200}};
    for (int i = 0; i < 3; i++) {
        struct picture picture = noise(sizes[i][0], sizes[i][1]);
        uint8_t *bytes;
        size_t size;
        assert_int_equal(picture_encode(&picture, &bytes, &size, NULL), RESULT_OK);
        png_image image = {.version = PNG_IMAGE_VERSION};
        assert_true(png_image_begin_read_from_memory(&image, bytes, size));
        assert_int_equal(image.width, sizes[i][0]);
        assert_int_equal(image.height, sizes[i][1]);
        assert_int_equal(image.format, PNG_FORMAT_RGB);
        uint8_t *back = alloc(PNG_IMAGE_SIZE(image), 1);
        assert_true(png_image_finish_read(&image, NULL, back, 0, NULL));
        assert_memory_equal(back, picture.rgb, PNG_IMAGE_SIZE(image));
        free(back);
        free(bytes);
        picture_fini(&picture);
    }
}

static void a_file_holds_the_png_or_the_error_names_it(void **state) {
    (void)state;
    char dir[FOLDER_MAX], path[128];
    struct error err;
    folder_make(dir);
    snprintf(path, sizeof path, "%s/picture.png", dir);
    struct picture picture = noise(64, 48);
    uint8_t *bytes, back[65536];
    size_t size;
    assert_int_equal(picture_encode(&picture, &bytes, &size, NULL), RESULT_OK);
    for (int i = 0; i < 2; i++) // and over a file that is there
        assert_int_equal(picture_write(&picture, path, &err), RESULT_OK);
    FILE *file = fopen(path, "rb");
    assert_int_equal(fread(back, 1, sizeof back, file), size);
    assert_memory_equal(back, bytes, size);
    fclose(file);
    folder_remove(dir);
    assert_int_equal(picture_write(&picture, path, &err), RESULT_MISSING);
    assert_non_null(strstr(err.text, path));
    assert_int_equal(picture_write(&picture, "/tmp", &err), RESULT_IO);
    assert_non_null(strstr(err.text, "/tmp: "));
    assert_int_equal(picture_write(&picture, "/dev/full", &err), RESULT_IO);
    assert_non_null(strstr(err.text, "/dev/full: No space"));
    free(bytes);
    picture_fini(&picture);
    picture = noise(2, 2); // noticed when the file is closed
    assert_int_equal(picture_write(&picture, "/dev/full", &err), RESULT_IO);
    picture_fini(&picture);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_sphere_is_a_disc_lit_as_its_normals_say),
        cmocka_unit_test(pixels_on_an_edge_are_blended_in_linear_light),
        cmocka_unit_test(the_nearest_surface_is_seen_and_a_translucent_one_seen_through),
        cmocka_unit_test(a_wall_darkens_its_foot),
        cmocka_unit_test(perspective_keeps_sizes_at_the_origin_and_shrinks_what_is_behind),
        cmocka_unit_test(paint_is_asked_in_the_frame_of_the_mesh),
        cmocka_unit_test(nothing_and_triangles_without_area_leave_the_background),
        cmocka_unit_test(the_same_scene_gives_the_same_bytes),
        cmocka_unit_test(a_fitted_camera_sees_the_whole_box_and_little_else),
        cmocka_unit_test(normals_are_smooth_below_the_crease_and_flat_above),
        cmocka_unit_test(lines_become_closed_rods),
        cmocka_unit_test(a_png_holds_every_pixel),
        cmocka_unit_test(a_file_holds_the_png_or_the_error_names_it),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
