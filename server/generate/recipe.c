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

static enum result refuse(struct recipe_reader *r, const char *section, const char *key,
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

static enum result read_point(struct recipe_reader *r, const char *section, const char *key,
                              const char *value, vec3 *out) {
    pose p;
    if (number_pose(value, &p) && p.rotation.w == 1 && vec3_length(p.translation) <= 100) {
        *out = p.translation;
        return RESULT_OK;
    }
    return refuse(r, section, key, "must be three numbers, x y z, within 100 mm of the origin");
}

// "[cavity NAME]": the cavity of that name, a new one where there is none yet.
static struct recipe_cavity *cavity_of(struct recipe_reader *r, const char *section) {
    const char *name = section + strlen("cavity ");
    struct recipe *recipe = r->recipe;
    for (int i = 0; i < recipe->cavity_count; i++)
        if (strcmp(recipe->cavities[i].name, name) == 0)
            return &recipe->cavities[i];
    if (recipe->cavity_count == RECIPE_CAVITIES_MAX || strlen(name) >= CASE_NAME_MAX)
        return NULL;
    struct recipe_cavity *cavity = &recipe->cavities[recipe->cavity_count++];
    *cavity = (struct recipe_cavity){.body = BODY_COUNT, .dent.at.x = NAN};
    snprintf(cavity->name, sizeof cavity->name, "%s", name);
    return cavity;
}

static enum result read_cavity(struct recipe_reader *r, const char *section, const char *key,
                               const char *value) {
    struct recipe_cavity *cavity = cavity_of(r, section);
    if (!cavity)
        return refuse(r, section, key, "at most 8 cavities, with names of at most 63 characters");
    if (strcmp(key, "body") == 0) {
        if (!body_from_name(value, &cavity->body) || cavity->body == BODY_PATELLA)
            return refuse(r, section, key, "must be femur or tibia");
        return RESULT_OK;
    }
    if (strcmp(key, "at") == 0)
        return read_point(r, section, key, value, &cavity->dent.at);
    if (strcmp(key, "radius_mm") == 0)
        return read_number(r, section, key, value, 3, 25, &cavity->dent.radius_mm);
    if (strcmp(key, "depth_mm") == 0)
        return read_number(r, section, key, value, 0.1, 6, &cavity->dent.depth_mm);
    return refuse(r, section, key, "unknown key");
}

// "[tear NAME]": as with cavities.
static struct recipe_tear *tear_of(struct recipe_reader *r, const char *section) {
    const char *name = section + strlen("tear ");
    struct recipe *recipe = r->recipe;
    for (int i = 0; i < recipe->tear_count; i++)
        if (strcmp(recipe->tears[i].name, name) == 0)
            return &recipe->tears[i];
    if (recipe->tear_count == RECIPE_TEARS_MAX || strlen(name) >= CASE_NAME_MAX)
        return NULL;
    struct recipe_tear *tear = &recipe->tears[recipe->tear_count++];
    *tear = (struct recipe_tear){.tear.kind = TEAR_KIND_COUNT};
    snprintf(tear->name, sizeof tear->name, "%s", name);
    return tear;
}

static enum result read_tear(struct recipe_reader *r, const char *section, const char *key,
                             const char *value) {
    struct recipe_tear *tear = tear_of(r, section);
    if (!tear)
        return refuse(r, section, key, "at most 4 tears, with names of at most 63 characters");
    if (strcmp(key, "kind") == 0) {
        if (!tear_kind_from_name(value, &tear->tear.kind))
            return refuse(r, section, key, "must be radial, flap, bucket-handle or horizontal");
        return RESULT_OK;
    }
    if (strcmp(key, "group") == 0) {
        if (strcmp(value, "meniscus_medial") != 0 && strcmp(value, "meniscus_lateral") != 0)
            return refuse(r, section, key, "must be meniscus_medial or meniscus_lateral");
        strcpy(tear->group, value);
        return RESULT_OK;
    }
    if (strcmp(key, "at") == 0)
        return read_number(r, section, key, value, 0.1, 0.9, &tear->tear.at);
    if (strcmp(key, "depth_mm") == 0)
        return read_number(r, section, key, value, 1, 8, &tear->tear.depth_mm);
    if (strcmp(key, "length_mm") == 0)
        return read_number(r, section, key, value, 2, 30, &tear->tear.length_mm);
    return refuse(r, section, key, "unknown key");
}

struct series_key {
    const char *key;
    size_t offset; // in struct recipe_ligament
    double low, high;
};

static const struct series_key series_keys[] = {
    {"flexion_deg", offsetof(struct recipe_ligament, flexion_deg), 0, 120},
    {"valgus_deg", offsetof(struct recipe_ligament, valgus_deg), -15, 15},
    {"internal_deg", offsetof(struct recipe_ligament, internal_deg), -30, 30},
    {"drawer_mm", offsetof(struct recipe_ligament, drawer_mm), -10, 10},
    {"extra_valgus_deg", offsetof(struct recipe_ligament, extra_valgus_deg), -15, 15},
    {"extra_internal_deg", offsetof(struct recipe_ligament, extra_internal_deg), -30, 30},
    {"extra_drawer_mm", offsetof(struct recipe_ligament, extra_drawer_mm), -15, 15},
};

static bool parse_series(const char *value, const struct series_key *k, struct recipe_series *out) {
    char text[256], *rest;
    if (snprintf(text, sizeof text, "%s", value) >= (int)sizeof text)
        return false;
    for (char *w = strtok_r(text, " \t", &rest); w; w = strtok_r(NULL, " \t", &rest))
        if (out->count == RECIPE_SERIES_MAX ||
            !number_double(w, k->low, k->high, &out->values[out->count++]))
            return false;
    return out->count > 0;
}

// "[ligament NAME]": as with cavities.
static struct recipe_ligament *ligament_of(struct recipe_reader *r, const char *section) {
    const char *name = section + strlen("ligament ");
    struct recipe *recipe = r->recipe;
    for (int i = 0; i < recipe->ligament_count; i++)
        if (strcmp(recipe->ligaments[i].name, name) == 0)
            return &recipe->ligaments[i];
    if (recipe->ligament_count == CASE_LIGAMENTS_MAX || !case_name_is_valid(name))
        return NULL;
    struct recipe_ligament *ligament = &recipe->ligaments[recipe->ligament_count++];
    strcpy(ligament->name, name);
    return ligament;
}

static enum result read_ligament(struct recipe_reader *r, const char *section, const char *key,
                                 const char *value) {
    struct recipe_ligament *ligament = ligament_of(r, section);
    if (!ligament)
        return refuse(r, section, key,
                      "at most 8 ligaments, with names of letters, digits and \"_-.\"");
    for (size_t i = 0; i < sizeof series_keys / sizeof *series_keys; i++) {
        const struct series_key *k = &series_keys[i];
        if (strcmp(key, k->key) != 0)
            continue;
        if (parse_series(value, k, (struct recipe_series *)((char *)ligament + k->offset)))
            return RESULT_OK;
        return r->result = fail(r->err, RESULT_INVALID,
                                "[%s] %s = %s: must be up to %d numbers from %g to %g", section,
                                key, value, RECIPE_SERIES_MAX, k->low, k->high);
    }
    return refuse(r, section, key, "unknown key");
}

static enum result read_knee(struct recipe_reader *r, const char *section, const char *key,
                             const char *value) {
    if (strcmp(section, "knee") == 0 && strcmp(key, "title") == 0) {
        if (strlen(value) >= sizeof r->recipe->title)
            return refuse(r, section, key, "must be at most 127 characters");
        strcpy(r->recipe->title, value);
        return RESULT_OK;
    }
    if (strcmp(section, "knee") == 0 && strcmp(key, "side") == 0) {
        bool left = strcmp(value, "left") == 0;
        r->recipe->side = left ? SIDE_LEFT : SIDE_RIGHT;
        if (!left && strcmp(value, "right") != 0)
            return refuse(r, section, key, "must be right or left");
        return RESULT_OK;
    }
    for (size_t i = 0; i < sizeof number_keys / sizeof *number_keys; i++) {
        const struct recipe_key *k = &number_keys[i];
        if (strcmp(section, k->section) == 0 && strcmp(key, k->key) == 0)
            return read_number(r, section, key, value, k->low, k->high,
                               (double *)((char *)r->recipe + k->offset));
    }
    return refuse(r, section, key, "unknown key");
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
        return refuse(r, section, key, "given twice") == RESULT_OK;
    if (strncmp(section, "cavity ", strlen("cavity ")) == 0)
        return read_cavity(r, section, key, value) == RESULT_OK;
    if (strncmp(section, "tear ", strlen("tear ")) == 0)
        return read_tear(r, section, key, value) == RESULT_OK;
    if (strncmp(section, "ligament ", strlen("ligament ")) == 0)
        return read_ligament(r, section, key, value) == RESULT_OK;
    return read_knee(r, section, key, value) == RESULT_OK;
}

static enum result check_cavities(const struct recipe *recipe, struct error *err) {
    for (int i = 0; i < recipe->cavity_count; i++) {
        const struct recipe_cavity *c = &recipe->cavities[i];
        if (c->body == BODY_COUNT || isnan(c->dent.at.x) || c->dent.radius_mm == 0 ||
            c->dent.depth_mm == 0)
            return fail(err, RESULT_MISSING, "[cavity %s] needs body, at, radius_mm and depth_mm",
                        c->name);
        if (c->dent.depth_mm > c->dent.radius_mm / 2)
            return fail(err, RESULT_INVALID,
                        "[cavity %s] depth_mm = %g: must be at most %g, half of radius_mm", c->name,
                        c->dent.depth_mm, c->dent.radius_mm / 2);
    }
    return RESULT_OK;
}

static enum result check_tears(const struct recipe *recipe, struct error *err) {
    for (int i = 0; i < recipe->tear_count; i++) {
        const struct recipe_tear *t = &recipe->tears[i];
        bool radial = t->tear.kind == TEAR_RADIAL;
        if (t->tear.kind == TEAR_KIND_COUNT || t->group[0] == '\0' || t->tear.at == 0 ||
            t->tear.depth_mm == 0 || (t->tear.length_mm == 0) != radial)
            return fail(err, RESULT_MISSING,
                        "[tear %s] needs kind, group, at and depth_mm; length_mm too where it is "
                        "not radial, and only there",
                        t->name);
    }
    return RESULT_OK;
}

static bool is_zero(const struct recipe_series *series) {
    for (int i = 0; i < series->count; i++)
        if (series->values[i] != 0)
            return false;
    return true;
}

static enum result check_ligament(const struct recipe_ligament *l, struct error *err) {
    bool opens = !is_zero(&l->valgus_deg) || !is_zero(&l->internal_deg) || !is_zero(&l->drawer_mm);
    bool gives = !is_zero(&l->extra_valgus_deg) || !is_zero(&l->extra_internal_deg) ||
                 !is_zero(&l->extra_drawer_mm);
    if (!l->flexion_deg.count || !opens || !gives)
        return fail(err, RESULT_MISSING,
                    "[ligament %s] needs flexion_deg, where the mock-up's holds (valgus_deg, "
                    "internal_deg, drawer_mm), and extra_ of one of these",
                    l->name);
    for (int i = 1; i < l->flexion_deg.count; i++)
        if (!(l->flexion_deg.values[i] >= l->flexion_deg.values[i - 1] + 1))
            return fail(err, RESULT_INVALID,
                        "[ligament %s] flexion_deg: must rise by a degree at least", l->name);
    for (size_t i = 1; i < sizeof series_keys / sizeof *series_keys; i++) {
        int count =
            ((const struct recipe_series *)((const char *)l + series_keys[i].offset))->count;
        if (count > 1 && count != l->flexion_deg.count)
            return fail(err, RESULT_INVALID,
                        "[ligament %s] %s: must be one number, or %d as flexion_deg has", l->name,
                        series_keys[i].key, l->flexion_deg.count);
    }
    return RESULT_OK;
}

static enum result check_ligaments(const struct recipe *recipe, struct error *err) {
    int keys = 0;
    for (int i = 0; i < recipe->ligament_count; i++) {
        if (check_ligament(&recipe->ligaments[i], err) != RESULT_OK)
            return RESULT_INVALID;
        keys += recipe->ligaments[i].flexion_deg.count;
    }
    if (keys > CASE_KEYS_MAX)
        return fail(err, RESULT_LIMIT, "%d keys of all ligaments, more than %d", keys,
                    CASE_KEYS_MAX);
    return RESULT_OK;
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
    if (check_cavities(out_recipe, err) != RESULT_OK || check_tears(out_recipe, err) != RESULT_OK ||
        check_ligaments(out_recipe, err) != RESULT_OK)
        return fail_in(err, RESULT_INVALID, "%s: ", file);
    if (name_after_folder(file, out_recipe->name, err) != RESULT_OK)
        return RESULT_INVALID;
    if (out_recipe->title[0] == '\0')
        snprintf(out_recipe->title, sizeof out_recipe->title, "%s", out_recipe->name);
    return RESULT_OK;
}
