#include "cut/spread.h"

void spread(const struct cut_mesh *mesh,
            bool (*belongs)(const struct cut_mesh *mesh, uint32_t triangle),
            struct stamped_set *seen, struct ids *list, uint32_t triangle) {
    uint32_t next = list->count;
    stamped_set_put(seen, triangle, 0);
    for (ids_push(list, triangle); next < list->count; next++)
        for (size_t i = 0; i < 3; i++) {
            uint32_t beside = mesh->twins[3 * (size_t)list->at[next] + i] / 3;
            if (stamped_set_has(seen, beside) || !belongs(mesh, beside))
                continue;
            stamped_set_put(seen, beside, 0);
            ids_push(list, beside);
        }
}
