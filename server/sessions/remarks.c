#include "sessions/remarks.h"

#include "base/check.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void remarks_fini(struct remarks *r) {
    free(r->all);
    *r = (struct remarks){0};
}

void remarks_put(struct remarks *r, const struct remark *remark) {
    CHECK(remark_is_valid(remark));
    if (!r->all)
        r->all = alloc(REMARKS_MAX, sizeof *r->all);
    r->revision++;
    for (; r->count < (int)remark->number; r->count++)
        r->all[r->count] = (struct kept_remark){
            r->revision,
            {.number = (uint32_t)r->count + 1, .time_ns = remark->time_ns, .withdrawn = true}};
    r->all[remark->number - 1] = (struct kept_remark){r->revision, *remark};
}

void remarks_begin(struct remarks *r, uint64_t session, struct remarks *said) {
    struct remarks none = {0}, *from = said ? said : &none;
    uint64_t revision = r->revision + from->revision + 1;
    free(r->all);
    *r = (struct remarks){session, revision, from->count, from->all};
    for (int i = 0; i < r->count; i++)
        r->all[i].revision = revision;
    *from = none;
}

void remark_to_wire(const struct remark *r, int64_t start_ns, arthron_Remark *out) {
    *out = (arthron_Remark){
        .number = r->number,
        .time_ns = r->time_ns - start_ns,
        .has_marker = r->has_marker,
        .body = (arthron_Body)r->body,
        .has_point = true,
        .point = {r->point.x, r->point.y, r->point.z},
        .withdrawn = r->withdrawn,
    };
    snprintf(out->author, sizeof out->author, "%s", r->author);
    snprintf(out->text, sizeof out->text, "%s", r->text);
}
