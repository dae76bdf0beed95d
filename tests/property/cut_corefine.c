// Cuts beside CGAL's; built where that is installed.

#include "cutting/bites.h"
#include "cutting/corefine.h"
#include "cutting/specimens.h"
#include "cutting/trial.h"
#include "test.h"

#include <stdlib.h>

// Vertices that a cut made may merge with others nearer than 1e-3 mm, and a cut of less than
// 1e-4 mm³ is none.
#define AGREE_MM3 5e-4

struct counts {
    int compared, refused_there;
};

// `fresh`: each cut is made in a fresh mesh; otherwise they follow one another.
static void compare(enum specimen specimen, uint64_t seed, bool fresh, struct counts *counts) {
    struct mesh mesh;
    struct trial trial;
    struct biter *biter = malloc(sizeof *biter);
    specimen_make(specimen, &mesh);
    trial_init(&trial, &mesh);
    biter_init(biter, seed);
    for (int i = 0; i < 25; i++) {
        if (fresh && i > 0) {
            trial_fini(&trial);
            trial_init(&trial, &mesh);
        }
        biter_next(biter, trial.mesh);
        trial_cut(&trial, biter->last.parts, 1);
        assert_null(trial.fault);
        assert_true(trial.outcome != CUT_REFUSED);
        double due, pieces = 0;
        if (!corefine_difference(&trial.before, &biter->last.parts[0], &due)) {
            counts->refused_there++;
            continue;
        }
        for (int k = 0; k < trial.change.piece_count; k++)
            pieces += trial.change.pieces[k].volume;
        assert_near(snapshot_volume(&trial.now) + pieces, due, AGREE_MM3);
        counts->compared++;
    }
    free(biter);
    trial_fini(&trial);
    mesh_fini(&mesh);
}

static void compare_all(bool fresh) {
    struct counts counts = {0};
    for (int specimen = 0; specimen < SPECIMENS; specimen++)
        for (uint64_t seed = 31; seed < 34; seed++)
            compare((enum specimen)specimen, seed, fresh, &counts);
    print_message("%d cuts compared, %d refused by CGAL\n", counts.compared, counts.refused_there);
    assert_true(counts.compared > 250);
}

static void one_cut_leaves_the_volume_that_corefinement_leaves(void **state) {
    (void)state;
    compare_all(true);
}

static void a_cut_after_others_leaves_the_volume_that_corefinement_leaves(void **state) {
    (void)state;
    compare_all(false);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_cut_leaves_the_volume_that_corefinement_leaves),
        cmocka_unit_test(a_cut_after_others_leaves_the_volume_that_corefinement_leaves),
    };
    return cmocka_run_group_tests_name("cut_corefine", tests, NULL, NULL);
}
