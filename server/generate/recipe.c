#include "base/number.h"
#include "generate/generate.h"
#include "generate/maxcut.h"

#include <errno.h>
#include <ini.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#define KEYS_MAX 128

struct recipe_reader {
    struct recipe *recipe;
    struct error *err;
    enum result result;       // of the first entry that was refused
    char seen[KEYS_MAX][128]; // "section/key" so far
    int seen_count;
};

struct recipe_key {
    const char *section, *key;
    size_t offset; // in struct recipe
    double low, high;
};

static const struct recipe_key number_keys[] = {
    {"knee", "size", offsetof(struct recipe, size), 0.8, 1.2},
    {"mesh", "resolution_mm", offsetof(struct recipe, resolution_mm), 1.2, 3},
    {"menisci", "medial_cm3", offsetof(struct recipe, meniscus_medial_cm3), 1.4, 2.5},
    {"menisci", "lateral_cm3", offsetof(struct recipe, meniscus_lateral_cm3), 1.4, 2.5},
    {"menisci", "rim_mm", offsetof(struct recipe, rim_mm), MAXCUT_RIM_LEAST_MM, MAXCUT_RIM_MOST_MM},
};

static enum result refuse_entry(struct recipe_reader *r, const char *section, const char *key,
                                const char *reason) {
    return r->result = fail(r->err, RESULT_INVALID, "[%s] %s: %s", section, key, reason);
}

static enum result read_number(struct recipe_reader *r, const char *section, const char *key,
                               const char *value, double low, double high, double *out) {
    if (number_double(value, low, high, out))
        return RESULT_OK;
    return r->result = fail(r->err, RESULT_INVALID, "[%s] %s = %s: must be a number from %g to %g",
                            section, key, value, low, high);
}

// ---- steps --------------------------------------------------------------------------------------

static const int steps_max[PATHOLOGY_KIND_COUNT] = {
    [PATHOLOGY_LIGAMENT] = CASE_LIGAMENTS_MAX, [PATHOLOGY_CAVITY] = RECIPE_CAVITIES_MAX,
    [PATHOLOGY_WEAR] = RECIPE_WEAR_MAX,        [PATHOLOGY_TEAR] = RECIPE_MENISCUS_MAX,
    [PATHOLOGY_PLAN] = RECIPE_MENISCUS_MAX,    [PATHOLOGY_TISSUE] = RECIPE_TISSUES_MAX,
    [PATHOLOGY_LOOSE] = CASE_LOOSE_MAX,
};

static const char *const steps_limits[PATHOLOGY_KIND_COUNT] = {
    [PATHOLOGY_LIGAMENT] = "at most 8 ligaments, with names of letters, digits and \"_-.\"",
    [PATHOLOGY_CAVITY] = "at most 8 cavities, with names of at most 63 characters",
    [PATHOLOGY_WEAR] = "at most 8 patches of wear, with names of at most 63 characters",
    [PATHOLOGY_TEAR] = "at most 4 tears, with names of at most 63 characters",
    [PATHOLOGY_PLAN] = "at most 4 plans, with names of at most 63 characters",
    [PATHOLOGY_TISSUE] = "at most 8 tissues, with names of letters, digits and \"_-.\"",
    [PATHOLOGY_LOOSE] = "at most 8 loose bodies, with names of letters, digits and \"_-.\"",
};

// "[tear NAME]": the kind, and the name; NULL for another section.
static const char *name_of(const char *section, enum pathology_kind *out_kind) {
    for (int kind = 0; kind < PATHOLOGY_KIND_COUNT; kind++) {
        const char *word = pathology_kind_name((enum pathology_kind)kind);
        size_t length = strlen(word);
        *out_kind = (enum pathology_kind)kind;
        if (strncmp(section, word, length) == 0 && section[length] == ' ')
            return section + length + 1;
    }
    return NULL;
}

// The step of that kind and name, a new one where there is none yet; NULL where there is no room.
static struct pathology *step_of(struct recipe *recipe, enum pathology_kind kind,
                                 const char *name) {
    int same = 0;
    for (int i = 0; i < recipe->step_count; i++) {
        if (recipe->steps[i].kind == kind && strcmp(recipe->steps[i].name, name) == 0)
            return &recipe->steps[i];
        same += recipe->steps[i].kind == kind;
    }
    bool is_name =
        kind == PATHOLOGY_LIGAMENT || kind == PATHOLOGY_TISSUE || kind == PATHOLOGY_LOOSE;
    bool named = is_name ? case_name_is_valid(name) : strlen(name) < sizeof recipe->steps[0].name;
    if (same == steps_max[kind] || !named)
        return NULL;
    struct pathology *step = &recipe->steps[recipe->step_count++];
    pathology_init(step, kind, name);
    return step;
}

static enum result read_step(struct recipe_reader *r, const char *section, const char *key,
                             const char *value) {
    enum pathology_kind kind;
    const char *name = name_of(section, &kind);
    struct pathology *step = step_of(r->recipe, kind, name);
    if (!step)
        return refuse_entry(r, section, key, steps_limits[kind]);
    r->result = pathology_take(step, key, value, r->err);
    return r->result == RESULT_OK ? RESULT_OK : fail_in(r->err, r->result, "[%s] ", section);
}

static enum result check_steps(const struct recipe *recipe, struct error *err) {
    int keys = 0;
    for (int i = 0; i < recipe->step_count; i++) {
        const struct pathology *step = &recipe->steps[i];
        enum result result = pathology_check(step, err);
        if (result != RESULT_OK)
            return fail_in(err, result, "[%s %s] ", pathology_kind_name(step->kind), step->name);
        keys += step->kind == PATHOLOGY_LIGAMENT ? step->ligament.flexion_deg.count : 0;
        for (int k = 0; k < i && step->kind == PATHOLOGY_PLAN; k++)
            if (recipe->steps[k].kind == PATHOLOGY_PLAN &&
                strcmp(recipe->steps[k].plan.group, step->plan.group) == 0)
                return fail(err, RESULT_INVALID, "[plan %s] %s has a plan already", step->name,
                            step->plan.group);
    }
    if (keys > CASE_KEYS_MAX)
        return fail(err, RESULT_LIMIT, "%d keys of all ligaments, more than %d", keys,
                    CASE_KEYS_MAX);
    return RESULT_OK;
}

// ---- the knee -----------------------------------------------------------------------------------

static enum result read_knee(struct recipe_reader *r, const char *section, const char *key,
                             const char *value) {
    if (strcmp(section, "knee") == 0 && strcmp(key, "title") == 0) {
        if (strlen(value) >= sizeof r->recipe->title)
            return refuse_entry(r, section, key, "must be at most 127 characters");
        strcpy(r->recipe->title, value);
        return RESULT_OK;
    }
    if (strcmp(section, "knee") == 0 && strcmp(key, "side") == 0) {
        bool left = strcmp(value, "left") == 0;
        r->recipe->side = left ? SIDE_LEFT : SIDE_RIGHT;
        if (!left && strcmp(value, "right") != 0)
            return refuse_entry(r, section, key, "must be right or left");
        return RESULT_OK;
    }
    for (size_t i = 0; i < sizeof number_keys / sizeof *number_keys; i++) {
        const struct recipe_key *k = &number_keys[i];
        if (strcmp(section, k->section) == 0 && strcmp(key, k->key) == 0)
            return read_number(r, section, key, value, k->low, k->high,
                               (double *)((char *)r->recipe + k->offset));
    }
    return refuse_entry(r, section, key, "unknown key");
}

static bool seen_before(struct recipe_reader *r, const char *section, const char *key) {
    char name[sizeof r->seen[0]];
    snprintf(name, sizeof name, "%s/%s", section, key);
    for (int i = 0; i < r->seen_count; i++)
        if (strcmp(r->seen[i], name) == 0)
            return true;
    if (r->seen_count < KEYS_MAX)
        strcpy(r->seen[r->seen_count++], name);
    return false;
}

// inih goes on after an error: only the first one counts.
static int read_entry(void *user, const char *section, const char *key, const char *value) {
    struct recipe_reader *r = user;
    if (r->result != RESULT_OK)
        return 0;
    if (seen_before(r, section, key))
        return refuse_entry(r, section, key, "given twice") == RESULT_OK;
    enum pathology_kind kind;
    if (name_of(section, &kind))
        return read_step(r, section, key, value) == RESULT_OK;
    return read_knee(r, section, key, value) == RESULT_OK;
}

// The name of the folder that holds the file: of its whole path, or where a folder above may not be
// entered (the demo below root's home) of the path as given.
static enum result name_after_folder(const char *file, char name[CASE_NAME_MAX],
                                     struct error *err) {
    char *path = realpath(file, NULL);
    if (!path)
        path = strdup(file);
    char *end = path ? strrchr(path, '/') : NULL;
    if (end)
        *end = '\0';
    const char *slash = end ? strrchr(path, '/') : NULL, *folder = slash ? slash + 1 : path;
    bool valid = end && case_name_is_valid(folder);
    if (valid)
        snprintf(name, CASE_NAME_MAX, "%s", folder);
    free(path);
    if (!valid)
        return fail(err, RESULT_INVALID,
                    "%s: its folder's name becomes the case's: letters, digits and \"_-.\"", file);
    return RESULT_OK;
}

enum result recipe_load(const char *path, struct recipe *out_recipe, struct error *err) {
    struct stat status;
    bool folder = stat(path, &status) == 0 && S_ISDIR(status.st_mode);
    char file[4096];
    int length = snprintf(file, sizeof file, folder ? "%s/recipe.ini" : "%s", path);
    if (length < 0 || (size_t)length >= sizeof file)
        return fail(err, RESULT_LIMIT, "%s: the path is too long", path);
    *out_recipe = (struct recipe){.size = 1,
                                  .resolution_mm = 1.7,
                                  .meniscus_medial_cm3 = 2.4,
                                  .meniscus_lateral_cm3 = 2.4,
                                  .rim_mm = MAXCUT_RIM_MM};
    struct recipe_reader r = {.recipe = out_recipe, .err = err, .result = RESULT_OK};
    int line = ini_parse(file, read_entry, &r);
    if (line < 0)
        return fail(err, RESULT_IO, "%s: %s", file, strerror(errno));
    if (r.result != RESULT_OK)
        return fail_in(err, r.result, "%s:%d: ", file, line);
    if (line > 0)
        return fail(err, RESULT_FORMAT, "%s:%d: neither a section nor a key with a value", file,
                    line);
    if (check_steps(out_recipe, err) != RESULT_OK)
        return fail_in(err, RESULT_INVALID, "%s: ", file);
    if (name_after_folder(file, out_recipe->name, err) != RESULT_OK)
        return RESULT_INVALID;
    if (out_recipe->title[0] == '\0')
        snprintf(out_recipe->title, sizeof out_recipe->title, "%s", out_recipe->name);
    return RESULT_OK;
}
