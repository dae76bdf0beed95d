#include "base/check.h"
#include "report/html.h"
#include "report/tissue.h"
#include "scene/shapes.h"
#include "test.h"

#include <stdlib.h>
#include <string.h>

// ---- HTML ----

static void text_is_escaped_wherever_it_stands(void **state) {
    (void)state;
    char *text;
    size_t size;
    FILE *file = open_memstream(&text, &size);
    html_text(file, "<b>\"x\" & 'y'</b> – cm³ &amp;");
    fclose(file);
    assert_string_equal(text, "&lt;b&gt;&quot;x&quot; &amp; &#39;y&#39;&lt;/b&gt; – cm³ &amp;amp;");
    free(text);
    file = open_memstream(&text, &size);
    html_begin(file, "a < b");
    html_end(file);
    fclose(file);
    assert_non_null(strstr(text, "<title>a &lt; b</title>"));
    assert_non_null(strstr(text, "<h1>a &lt; b</h1>"));
    assert_null(strstr(text, "a < b"));
    free(text);
}

static int digit_of(char c) {
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    const char *at = strchr(digits, c);
    return at && c ? (int)(at - digits) : -1;
}

// Bit after bit, until what is no digit.
static size_t decode(const char *text, uint8_t *out) {
    size_t bits = 0;
    for (; digit_of(*text) >= 0; text++)
        for (int k = 5; k >= 0; k--, bits++) {
            uint8_t bit = (uint8_t)(digit_of(*text) >> k & 1);
            out[bits / 8] = (uint8_t)(bits % 8 ? out[bits / 8] << 1 | bit : bit);
        }
    return bits / 8;
}

static void a_picture_is_inside_the_page(void **state) {
    (void)state;
    size_t lengths[3] = {0};
    for (int width = 1; width < 40; width++) {
        struct picture picture;
        picture_init(&picture, width, 3);
        for (int i = 0; i < 9 * width; i++)
            picture.rgb[i] = (uint8_t)(i * i * 7);
        uint8_t *bytes, back[4096];
        char *text;
        size_t size, text_size;
        assert_int_equal(picture_encode(&picture, &bytes, &size, NULL), RESULT_OK);
        FILE *file = open_memstream(&text, &text_size);
        assert_int_equal(html_picture(file, &picture, "a \"b\"", "c < d", NULL), RESULT_OK);
        fclose(file);
        const char *data =
            strstr(text, "data:image/png;base64,") + strlen("data:image/png;base64,");
        assert_int_equal(decode(data, back), size);
        assert_memory_equal(back, bytes, size);
        assert_int_equal(strcspn(data, "\"") % 4, 0); // padded
        assert_non_null(strstr(text, "alt=\"a &quot;b&quot;\""));
        assert_non_null(strstr(text, "<figcaption>c &lt; d</figcaption>"));
        lengths[size % 3]++;
        free(text);
        free(bytes);
        picture_fini(&picture);
    }
    assert_true(lengths[0] && lengths[1] && lengths[2]);
}

static void a_plot_is_inside_the_page(void **state) {
    (void)state;
    char *text;
    size_t size;
    FILE *file = open_memstream(&text, &size);
    struct plot plot = {"Height", "", 300, 200, {.title = "x"}, {.title = "y"}, .line_count = 0};
    html_plot(file, &plot, "c < d");
    fclose(file);
    assert_int_equal(strncmp(text, "<figure><svg ", 13), 0);
    assert_non_null(strstr(text, "</svg>\n<figcaption>c &lt; d</figcaption></figure>"));
    free(text);
}

// ---- tissue ----

#define SIDE 500

static const uint32_t bluish = 0xa8c4d6;

// How many pixels are bluish, salmon, purple.
struct counts {
    int original, cut, displaced;
};

static struct counts draw(const struct tissue_look *look) {
    struct box box = {{-10, -10, -1}, {10, 10, 1}};
    struct camera camera = camera_fit(&box, (vec3){0, 0, 1}, (vec3){0, 1, 0}, 1, INFINITY);
    struct picture picture;
    struct counts counts = {0};
    assert_int_equal(tissue_picture(look, &camera, SIDE, SIDE, &picture, NULL), RESULT_OK);
    for (int i = 0; i < SIDE * SIDE; i++) {
        int r = picture.rgb[3 * i], g = picture.rgb[3 * i + 1], b = picture.rgb[3 * i + 2];
        counts.original += r < g && g < b;
        counts.cut += r > 1.2 * g && g > b;
        counts.displaced += b > r && r > 2 * g;
    }
    picture_fini(&picture);
    return counts;
}

static void cut_surfaces_and_displacements_stand_out(void **state) {
    (void)state;
    struct mesh mesh;
    shape_grid(&mesh, 8, 20);
    uint32_t *labels = alloc(mesh.triangle_count, sizeof *labels);
    struct tissue_look look = {.mesh = &mesh, .colour = bluish};
    struct counts plain = draw(&look);
    assert_int_equal(plain.cut + plain.displaced, 0);
    assert_true(plain.original > 100000);

    for (uint32_t t = 0; t < mesh.triangle_count / 4; t++)
        labels[t] = 1 + t % 3;
    look.labels = labels;
    struct counts cut = draw(&look);
    assert_near((double)cut.cut / (cut.cut + cut.original), 0.25, 0.02);

    const struct rod lines[] = {{{-7, -5, 1}, {7, -5, 1}}, {{-7, 5, 1}, {7, 5, 1}}};
    look.lines = lines;
    look.line_count = 1;
    int one = draw(&look).displaced;
    look.line_count = 2;
    assert_true(one >= 300);
    assert_near(draw(&look).displaced, 2 * one, 0.1 * one);
    free(labels);
    mesh_fini(&mesh);
}

// Two triangles from blend 0 on the left to 1 on the right: still bluish, green above red, up to
// 0.22.
static void blends_shade_the_surface(void **state) {
    (void)state;
    struct mesh mesh;
    double blends[4] = {0};
    shape_grid(&mesh, 8, 1);
    struct tissue_look look = {.mesh = &mesh, .colour = bluish, .blends = blends};
    int all = draw(&look).original;
    for (uint32_t v = 0; v < 4; v++)
        blends[v] = mesh_vertex(&mesh, v).x > 0;
    struct counts half = draw(&look);
    assert_near((double)half.original / all, 0.22, 0.03);
    assert_true(half.displaced > 0.2 * all);
    for (uint32_t v = 0; v < 4; v++)
        blends[v] = 1;
    assert_near(draw(&look).displaced, all, 0.02 * all); // edges are blended
    mesh_fini(&mesh);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(text_is_escaped_wherever_it_stands),
        cmocka_unit_test(a_picture_is_inside_the_page),
        cmocka_unit_test(a_plot_is_inside_the_page),
        cmocka_unit_test(cut_surfaces_and_displacements_stand_out),
        cmocka_unit_test(blends_shade_the_surface),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
