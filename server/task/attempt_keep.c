#include "task/attempt_keep.h"

#include <stddef.h>

// Hints are left out: they change nothing.
static void keep_one(struct attempt *a, struct kept *k) {
    kept_bytes(k, a, offsetof(struct attempt, hints));
    kept_holds(k, a->end == ATTEMPT_RUNS && a->occurrence_count >= 0 &&
                      a->occurrence_count <= ATTEMPT_OCCURRENCES_MAX && a->running_ns >= 0);
}

void kept_attempt_keep(struct kept_attempt *kept, struct kept *k) {
    kept_count(k, &kept->begun, UINT32_MAX);
    kept_count(k, &kept->number, UINT32_MAX);
    kept_holds(k, kept->number <= kept->begun);
    if (!kept->number)
        return;
    kept_time(k, &kept->begun_ns);
    keep_one(&kept->attempt, k);
}

static bool occurrences_fit(const struct attempt *a, const struct task *task) {
    bool fit = true;
    for (int i = 0; i < a->occurrence_count; i++)
        fit = fit && a->occurrences[i].error >= 0 && a->occurrences[i].error < task->error_count &&
              a->occurrences[i].tool >= -1 && a->occurrences[i].tool < INSTRUMENT_COUNT;
    return fit;
}

bool kept_attempt_fits(const struct kept_attempt *kept, const struct site *site) {
    const struct attempt *a = &kept->attempt;
    const struct task *task = site_task(site);
    bool fits = a->goals_met >= 0 && a->goals_met <= task->goal_count;
    for (int i = 0; i < task->goal_count; i++)
        fits =
            fits && a->goals[i].along >= 0 && a->goals[i].along <= site_goal(site, i)->line_count;
    return fits && occurrences_fit(a, task);
}
