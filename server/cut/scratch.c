#include "cut/clean.h"
#include "cut/flood.h"
#include "cut/stage.h"

#include <stdatomic.h>
#include <stdlib.h>

#define SPARES 4 // as many threads as may cut at once and find it warm

static _Atomic(struct cut_scratch *) spares[SPARES];

struct cut_scratch *scratch_take(void) {
    for (int i = 0; i < SPARES; i++) {
        struct cut_scratch *spare = atomic_exchange(&spares[i], NULL);
        if (spare)
            return spare;
    }
    struct cut_scratch *scratch = alloc(1, sizeof *scratch);
    scratch->stage = stage_create();
    scratch->flood = alloc(1, sizeof *scratch->flood);
    scratch->cleaner = alloc(1, sizeof *scratch->cleaner);
    return scratch;
}

static void destroy(struct cut_scratch *s) {
    stamped_set_fini(&s->undo.triangles_seen);
    stamped_set_fini(&s->undo.vertices_seen);
    ids_fini(&s->undo.gone);
    free(s->undo.triangles);
    free(s->undo.vertices);
    stage_destroy(&s->stage);
    flood_fini(s->flood);
    free(s->flood);
    cleaner_fini(s->cleaner);
    free(s->cleaner);
    free(s);
}

void scratch_give(struct cut_scratch **scratch) {
    struct cut_scratch *s = *scratch;
    *scratch = NULL;
    for (int i = 0; s && i < SPARES; i++) {
        struct cut_scratch *none = NULL;
        if (atomic_compare_exchange_strong(&spares[i], &none, s))
            s = NULL;
    }
    if (s)
        destroy(s);
}
