// Recipe files, good and at fault.
#include "folder.h"
#include "generate/generate.h"
#include "test.h"

#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

static enum result load_text(const char *text, struct recipe *out_recipe, struct error *err) {
    char folder[FOLDER_MAX], dir[128], path[160];
    folder_make(folder);
    snprintf(dir, sizeof dir, "%s/of-text", folder);
    assert_int_equal(mkdir(dir, 0777), 0);
    snprintf(path, sizeof path, "%s/recipe.ini", dir);
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs(text, file);
    fclose(file);
    enum result result = recipe_load(dir, out_recipe, err);
    folder_remove(folder);
    return result;
}

static void a_recipe_says_all_that_a_knee_is_made_from(void **state) {
    (void)state;
    struct recipe recipe;
    struct error err;
    if (load_text("[knee]\ntitle = A knee\nside = left\nsize = 0.9\n[mesh]\nresolution_mm = 2\n"
                  "[menisci]\nmedial_cm3 = 2\nlateral_cm3 = 1.5\nrim_mm = 4\n"
                  "[cavity a]\nbody = tibia\nat = 1 -2 3.5\nradius_mm = 8\ndepth_mm = 3\n"
                  "[cavity b]\nbody = femur\nat = 0 0 0\nradius_mm = 4\ndepth_mm = 2\n"
                  "[tear c]\nkind = bucket-handle\ngroup = meniscus_lateral\nat = 0.4\n"
                  "depth_mm = 3\nlength_mm = 12\n"
                  "[ligament pcl]\nflexion_deg = 30  90.5\ndrawer_mm = -4\t-5\n"
                  "extra_drawer_mm = -8\nextra_internal_deg = 0 1\n"
                  "[ligament mcl]\nvalgus_deg = 5\nextra_valgus_deg = 10\nflexion_deg = 20\n"
                  "[plan d]\ngroup = meniscus_medial\nat = 0.3\ndepth_mm = 9\nlength_mm = 8\n",
                  &recipe, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    assert_string_equal(recipe.title, "A knee");
    assert_int_equal(recipe.side, SIDE_LEFT);
    assert_near(recipe.size, 0.9, 0);
    assert_near(recipe.resolution_mm, 2, 0);
    assert_near(recipe.meniscus_medial_cm3, 2, 0);
    assert_near(recipe.meniscus_lateral_cm3, 1.5, 0);
    assert_near(recipe.rim_mm, 4, 0);
    assert_int_equal(recipe.step_count, 6);
    const struct pathology *steps = recipe.steps;
    assert_string_equal(steps[0].name, "a");
    assert_int_equal(steps[0].kind, PATHOLOGY_CAVITY);
    assert_vec3_near(steps[0].cavity.place.at, ((vec3){1, -2, 3.5}), 0);
    assert_int_equal(steps[1].cavity.place.body, BODY_FEMUR);
    assert_string_equal(steps[2].name, "c");
    assert_int_equal(steps[2].kind, PATHOLOGY_TEAR);
    assert_string_equal(steps[2].tear.group, "meniscus_lateral");
    assert_int_equal(steps[2].tear.tear.kind, TEAR_BUCKET_HANDLE);
    assert_near(steps[2].tear.tear.at, 0.4, 0);
    assert_near(steps[2].tear.tear.depth_mm, 3, 0);
    assert_near(steps[2].tear.tear.length_mm, 12, 0);
    assert_string_equal(steps[3].name, "pcl");
    assert_int_equal(steps[3].kind, PATHOLOGY_LIGAMENT);
    const struct pathology_ligament *pcl = &steps[3].ligament;
    assert_int_equal(pcl->flexion_deg.count, 2);
    assert_near(pcl->flexion_deg.values[1], 90.5, 0);
    assert_near(pcl->drawer_mm.values[0], -4, 0);
    assert_near(pcl->drawer_mm.values[1], -5, 0);
    assert_int_equal(pcl->extra_drawer_mm.count, 1);
    assert_near(pcl->extra_internal_deg.values[1], 1, 0);
    assert_int_equal(pcl->valgus_deg.count, 0);
    assert_string_equal(steps[4].name, "mcl");
    assert_near(steps[4].ligament.extra_valgus_deg.values[0], 10, 0);
    assert_int_equal(steps[5].kind, PATHOLOGY_PLAN);
    assert_string_equal(steps[5].plan.group, "meniscus_medial");
    assert_near(steps[5].plan.resection.at, 0.3, 0);
    assert_near(steps[5].plan.resection.depth_mm, 9, 0);
    assert_near(steps[5].plan.resection.length_mm, 8, 0);
    assert_string_equal(recipe.name, "of-text");
}

static void a_wrong_recipe_is_refused_with_line_section_and_key(void **state) {
    (void)state;
    static const struct {
        const char *text, *said;
    } rows[] = {
        {"[knee]\ncolour = red\n", "recipe.ini:2: [knee] colour: unknown key"},
        {"[hip]\nside = left\n", "[hip] side: unknown key"},
        {"side = left\n", "[] side: unknown key"},
        {"[knee]\n\nside = middle\n", "recipe.ini:3: [knee] side: must be right or left"},
        {"[knee]\nsize = 1.3\n", "[knee] size = 1.3: must be a number from 0.8 to 1.2"},
        {"[knee]\nsize = 0.79\n", "from 0.8 to 1.2"},
        {"[knee]\nsize = big\n", "from 0.8 to 1.2"},
        {"[knee]\nsize = nan\n", "from 0.8 to 1.2"},
        {"[knee]\nsize = 1 mm\n", "from 0.8 to 1.2"},
        {"[knee]\nsize = 1\nsize = 1\n", "recipe.ini:3: [knee] size: given twice"},
        {"[mesh]\nresolution_mm = 1\n", "from 1.2 to 3"},
        {"[menisci]\nmedial_cm3 = 3\n", "from 1.4 to 2.5"},
        {"[menisci]\nlateral_cm3 = 1\n", "from 1.4 to 2.5"},
        {"[menisci]\nrim_mm = 1\n", "[menisci] rim_mm = 1: must be a number from 2 to 8"},
        {"[cavity a]\nbody = patella\n", "[cavity a] body: must be femur or tibia"},
        {"[cavity a]\nat = 1 2\n", "[cavity a] at: must be a landmark, or three numbers"},
        {"[cavity a]\nat = 1 2 300\n", "within 100 mm"},
        {"[cavity a]\nradius_mm = 2\n", "from 3 to 25"},
        {"[cavity a]\ndepth_mm = 7\n", "from 0.1 to 6"},
        {"[cavity a]\nwidth = 7\n", "[cavity a] width: unknown key"},
        {"[cavity a]\nbody = tibia\n", "[cavity a] needs body, at, radius_mm and depth_mm"},
        {"[cavity a]\nbody = tibia\nradius_mm = 5\ndepth_mm = 2\n", "[cavity a] needs"},
        {"[cavity a]\nbody = tibia\nat = 0 0 0\nradius_mm = 5\ndepth_mm = 3\n",
         "[cavity a] depth_mm = 3: must be at most 2.5"},
        {"[tear a]\nkind = zigzag\n", "must be radial, flap, bucket-handle or horizontal"},
        {"[tear a]\ngroup = a b\n", "must be the name of a group"},
        {"[tear a]\nat = 0.05\n", "[tear a] at = 0.05: must be a number from 0.1 to 0.9"},
        {"[tear a]\ndepth_mm = 9\n", "from 1 to 8"},
        {"[tear a]\nlength_mm = 31\n", "from 2 to 30"},
        {"[tear a]\nwidth_mm = 1\n", "[tear a] width_mm: unknown key"},
        {"[tear a]\nkind = radial\nat = 0.5\ndepth_mm = 3\n", "[tear a] needs kind, group"},
        {"[tear a]\nkind = radial\ngroup = meniscus_medial\nat = 0.5\ndepth_mm = 3\n"
         "length_mm = 9\n",
         "length_mm too where it is not radial, and only there"},
        {"[tear a]\nkind = flap\ngroup = meniscus_medial\nat = 0.5\ndepth_mm = 3\n",
         "[tear a] needs"},
        {"[tear a]\nat = 0.5\n[tear b]\nat = 0.5\n[tear c]\nat = 0.5\n[tear d]\nat = 0.5\n"
         "[tear e]\nat = 0.5\n",
         "[tear e] at: at most 4 tears"},
#define PLAN(name) "[plan " name "]\ngroup = meniscus_medial\nat = 0.5\ndepth_mm = 3\n"
        {PLAN("a"), "[plan a] needs group, at, depth_mm and length_mm"},
        {PLAN("a") "length_mm = 9\n" PLAN("b") "length_mm = 9\n",
         "[plan b] meniscus_medial has a plan already"},
        {"[plan a]\nkind = flap\n", "[plan a] kind: unknown key"},
        {"[plan a]\ngroup = a b\n", "must be the name of a group"},
        {"[plan a]\ndepth_mm = 9.5\n", "[plan a] depth_mm = 9.5: must be a number from 1 to 9"},
        {"[loose a]\ncount = 9\n", "[loose a] count: must be a number from 1 to 8"},
        {"[loose a]\nbody = patella\n", "[loose a] body: must be femur or tibia"},
        {"[loose a]\nradii_mm = 3 3 7\n", "[loose a] radii_mm: must be three numbers from 1 to 6"},
        {"[loose a]\nat = 1 2\n", "[loose a] at: must be a landmark, or three numbers"},
        {"[loose a]\nbody = tibia\n", "[loose a] needs either count, or body and at"},
        {"[loose a]\ncount = 2\nbody = tibia\nat = notch\n", "[loose a] needs either count"},
        {"[loose a]\nmass_g = 2\n", "[loose a] mass_g: unknown key"},
        {"[wear a]\nbody = skin\n", "[wear a] body: must be femur, tibia or patella"},
        {"[wear a]\ngrade = 4.5\n", "[wear a] grade = 4.5: must be a number from 1 to 4"},
        {"[wear a]\ndepth_mm = 1\n", "[wear a] depth_mm: unknown key"},
        {"[wear a]\nbody = tibia\nat = 0 0 0\ngrade = 2\n", "[wear a] needs body, at, radius_mm"},
#define WEAR(name) "[wear " name "]\nbody = tibia\nat = 0 0 0\nradius_mm = 5\ngrade = 2\n"
        {WEAR("a") WEAR("b") WEAR("c") WEAR("d") WEAR("e") WEAR("f") WEAR("g") WEAR("h") WEAR("i"),
         "[wear i] body: at most 8 patches of wear"},
        {"[cavities]\nat = 1\n", "[cavities] at: unknown key"},
        {"[tear]\nat = 0.5\n", "[tear] at: unknown key"},
#define KEYS "[ligament mcl]\nflexion_deg = 20 50\n"
        {KEYS "valgus_deg = 5\n", "[ligament mcl] needs flexion_deg, where"},
        {KEYS "valgus_deg = 0\nextra_valgus_deg = 10\n", "[ligament mcl] needs"},
        {KEYS "valgus_deg = 5\nextra_valgus_deg = 0 0\n", "[ligament mcl] needs"},
        {"[ligament mcl]\nvalgus_deg = 5\nextra_valgus_deg = 9\n", "[ligament mcl] needs"},
        {KEYS "valgus_deg = 16\n", "valgus_deg = 16: must be up to 8 numbers from -15 to 15"},
        {KEYS "valgus_deg = 5 five\n", "valgus_deg = 5 five: must be up to 8 numbers"},
        {KEYS "valgus_deg =\n", "[ligament mcl] valgus_deg = : must be up to 8 numbers"},
        {KEYS "drawer_mm = 1 2 3 4 5 6 7 8 9\n", "must be up to 8 numbers from -10 to 10"},
        {KEYS "extra_drawer_mm = 15.5\n", "must be up to 8 numbers from -15 to 15"},
        {KEYS "internal_deg = nan\n", "must be up to 8 numbers from -30 to 30"},
        {KEYS "valgus_deg = 5 5 5\nextra_valgus_deg = 10\n",
         "[ligament mcl] valgus_deg: must be one number, or 2 as flexion_deg has"},
        {"[ligament mcl]\nflexion_deg = 20 20.5\nvalgus_deg = 5\nextra_valgus_deg = 9\n",
         "flexion_deg: must rise by a degree at least"},
        {KEYS "side = left\n", "[ligament mcl] side: unknown key"},
        {KEYS "flexion_deg = 20\n", "recipe.ini:3: [ligament mcl] flexion_deg: given twice"},
#define FIVE(name)                                                                                 \
    "[ligament " name "]\nflexion_deg = 1 2 3 4 5\ndrawer_mm = 5\nextra_drawer_mm = 5\n"
        {FIVE("a") FIVE("b") FIVE("c") FIVE("d") FIVE("e") FIVE("f") FIVE("g"),
         "35 keys of all ligaments, more than 32"},
        {"[ligament a b]\nflexion_deg = 20\n", "with names of letters, digits"},
        {"[ligament ]\nflexion_deg = 20\n", "with names of letters, digits"},
        {"[tissue a b]\nkind = bone\n", "[tissue a b] kind: at most 8 tissues, with names of"},
        {"[tissue a]\nkind = muscle\n", "[tissue a] kind: must be bone, cartilage"},
        {"[tissue a]\nlabel = \xff\n", "[tissue a] label: must be 1 to 63 bytes of text"},
        {"[tissue a]\ncolour = 123456\n", "[tissue a] colour: must be #rrggbb"},
        {"[tissue a]\nside = left\n", "[tissue a] side: must be medial, lateral or none"},
        {"[tissue a]\ncuttable = true\n", "[tissue a] cuttable: must be yes or no"},
        {"[tissue a]\nbody = skin\n", "[tissue a] body: must be femur, tibia or patella"},
        {"[tissue a]\npath = 0 0 0\n", "[tissue a] path: must be 2 to 4 places"},
        {"[tissue a]\npath = 0 0 0 1 2\n", "[tissue a] path: must be 2 to 4 places"},
        {"[tissue a]\npath = 0 0 0 0 0 101\n", "each x y z, within 100 mm"},
        {"[tissue a]\nflat = 0 0 0\n", "[tissue a] flat: must be a direction"},
        {"[tissue a]\nwidth_mm = 0.4\n", "[tissue a] width_mm = 0.4: must be a number from 0.5"},
        {"[tissue a]\nlength_mm = 9\n", "[tissue a] length_mm: unknown key"},
        {"[tissue a]\nbody = tibia\n", "[tissue a] a new group needs body, path, width_mm"},
        {"[tissue a]\nbridges = tibia\n", "one that is there has none of these"},
        {"[tissue a]\nbody = tibia\npath = 0 0 0 1 0 0\nwidth_mm = 2\nthickness_mm = 2\n",
         "[tissue a] path: its ends must be 3 mm apart at least"},
        {"[knee\nside = left\n", "recipe.ini:1: "},
        {"[knee]\nside\n", "recipe.ini:2: neither a section nor a key"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct recipe recipe;
        struct error err = {""};
        if (load_text(rows[i].text, &recipe, &err) == RESULT_OK || !strstr(err.text, rows[i].said))
            fail_msg("\"%s\" gave \"%s\", not \"%s\"", rows[i].text, err.text, rows[i].said);
    }
}

static void a_recipe_that_is_not_there_is_named(void **state) {
    (void)state;
    struct recipe recipe;
    struct error err;
    assert_int_equal(recipe_load("/nowhere/recipe.ini", &recipe, &err), RESULT_IO);
    assert_non_null(strstr(err.text, "/nowhere/recipe.ini"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_recipe_says_all_that_a_knee_is_made_from),
        cmocka_unit_test(a_wrong_recipe_is_refused_with_line_section_and_key),
        cmocka_unit_test(a_recipe_that_is_not_there_is_named),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
