#include "task/tell.h"

#include <jansson.h>
#include <stdio.h>

static json_t *goals_json(const struct task *task, const struct attempt *attempt) {
    json_t *goals = json_array();
    for (int i = 0; i < task->goal_count; i++) {
        const struct goal_state *state = &attempt->goals[i];
        json_array_append_new(goals,
                              json_pack("{s:s, s:b, s:f}", "name", task->goals[i].name, "met",
                                        state->met, "s", 1e-9 * (double)state->met_ns));
    }
    return goals;
}

static json_t *errors_json(const struct task *task, const struct attempt *attempt) {
    json_t *errors = json_array();
    for (int i = 0; i < attempt->occurrence_count; i++) {
        const struct occurrence *o = &attempt->occurrences[i];
        json_array_append_new(errors,
                              json_pack("{s:s, s:f, s:I}", "name", task->errors[o->error].name, "s",
                                        1e-9 * (double)o->time_ns, "step", (json_int_t)o->step));
    }
    return errors;
}

json_t *tell_object(const struct task *task, const struct attempt *attempt, const char *why) {
    return json_pack("{s:s, s:i, s:s, s:s, s:s, s:f, s:i, s:o, s:o}", "task", task->name, "version",
                     task->version, "verdict", verdict_name(attempt_verdict(attempt, task)), "end",
                     attempt_end_name(attempt->end), "why", why, "time_s", attempt_time_s(attempt),
                     "error_count", attempt->errors, "goals", goals_json(task, attempt), "errors",
                     errors_json(task, attempt));
}

void tell_json(const struct task *task, const struct attempt *attempt, const char *why) {
    json_t *root = tell_object(task, attempt, why);
    json_dumpf(root, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(6));
    putchar('\n');
    json_decref(root);
}

// ---- for the records ----------------------------------------------------------------------------

static bool put(json_t *value, char *out, size_t size) {
    size_t used = json_dumpb(value, out, size, JSON_COMPACT | JSON_REAL_PRECISION(6));
    bool fits = used < size;
    out[fits ? used : 0] = '\0';
    json_decref(value);
    return fits;
}

static json_t *met_json(const struct task *task, const struct attempt *attempt) {
    json_t *goals = json_array();
    for (int i = 0; i < task->goal_count; i++) {
        const struct goal_state *state = &attempt->goals[i];
        json_array_append_new(
            goals, json_pack("{s:s, s:o}", "name", task->goals[i].name, "met_s",
                             state->met ? json_real(1e-9 * (double)state->met_ns) : json_null()));
    }
    return goals;
}

static json_t *resections_json(const struct site *site, const struct attempt *attempt) {
    const struct knee_case *knee = site_case(site);
    json_t *all = json_array();
    for (int group = 0; group < knee->group_count; group++) {
        int tissue = site_tissue(site, group);
        if (tissue < 0 || !(attempt->cut >> tissue & 1))
            continue;
        const struct quality_report *r = &attempt->resections[tissue];
        json_array_append_new(all, json_pack("{s:s, s:f, s:f, s:f, s:f, s:f, s:f}", "group",
                                             knee->groups[group].name, "removed_mm3",
                                             r->removed_mm3, "planned_mm3", r->planned_mm3,
                                             "over_mm3", r->over_mm3, "under_mm3", r->under_mm3,
                                             "rim_mm", r->rim_mm, "step_mm", r->step_mm));
    }
    return all;
}

bool tell_figures(const struct site *site, const struct attempt *attempt, char *out, size_t size) {
    return put(json_pack("{s:o, s:o}", "goals", met_json(site_task(site), attempt), "resections",
                         resections_json(site, attempt)),
               out, size);
}

bool tell_occurrences(const struct site *site, const struct attempt *attempt, char *out,
                      size_t size) {
    json_t *all = json_array();
    for (int i = 0; i < attempt->occurrence_count; i++) {
        const struct occurrence *o = &attempt->occurrences[i];
        const char *tool = o->tool < 0 ? "" : site_tools(site)->of[o->tool].name;
        json_array_append_new(all, json_pack("{s:s, s:s, s:I, s:f}", "error",
                                             site_task(site)->errors[o->error].name, "tool", tool,
                                             "step", (json_int_t)o->step, "time_s",
                                             1e-9 * (double)o->time_ns));
    }
    return put(all, out, size);
}

// ---- for people ---------------------------------------------------------------------------------

static void print_resection(const struct quality_report *r) {
    printf(
        "  plan  %.0f mm3: %.0f still there, %.0f removed beyond it; rim %.1f mm, step %.1f mm\n",
        r->planned_mm3, r->under_mm3, r->over_mm3, r->rim_mm, r->step_mm);
}

void tell_text(const struct task *task, const struct attempt *attempt, const char *why) {
    printf("%s: %s after %.1f s (at most %g), %d errors (at most %d)\n", task->title,
           verdict_name(attempt_verdict(attempt, task)), attempt_time_s(attempt), task->pass_time_s,
           attempt->errors, task->pass_errors);
    for (int i = 0; i < task->goal_count; i++) {
        const struct goal_state *state = &attempt->goals[i];
        if (state->met)
            printf("  goal  %-24s %6.1f s\n", task->goals[i].name, 1e-9 * (double)state->met_ns);
        else
            printf("  goal  %-24s not met\n", task->goals[i].name);
    }
    for (int i = 0; i < attempt->occurrence_count; i++)
        printf("  error %-24s %6.1f s, step %llu\n",
               task->errors[attempt->occurrences[i].error].name,
               1e-9 * (double)attempt->occurrences[i].time_ns,
               (unsigned long long)attempt->occurrences[i].step);
    for (int i = 0; i < TISSUES_MAX; i++)
        if (attempt->cut >> i & 1)
            print_resection(&attempt->resections[i]);
    if (why[0])
        printf("  why   %s\n", why);
}
