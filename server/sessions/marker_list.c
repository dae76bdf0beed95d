#include "sessions/marker_list.h"

#include "base/check.h"

#include <stdlib.h>

void marker_list_fini(struct marker_list *list) {
    free(list->all);
    *list = (struct marker_list){0};
}

void marker_list_begin(struct marker_list *list, uint64_t session, struct marker_list *before) {
    struct marker_list none = {0}, *from = before ? before : &none;
    free(list->all);
    *list = (struct marker_list){session, from->count, from->all};
    *from = none;
}

void marker_list_put(struct marker_list *list, const struct marker *marker) {
    CHECK(marker_is_valid(marker));
    if (!list->all)
        list->all = alloc(MARKERS_KEPT, sizeof *list->all);
    list->all[list->count++ % MARKERS_KEPT] = *marker;
}

int marker_list_get(const struct marker_list *list, uint64_t *told, struct marker *out, int room) {
    int count = 0;
    if (list->count > MARKERS_KEPT && *told < list->count - MARKERS_KEPT)
        *told = list->count - MARKERS_KEPT;
    for (; *told < list->count && count < room; ++*told)
        out[count++] = list->all[*told % MARKERS_KEPT];
    return count;
}
