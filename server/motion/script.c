#include "base/number.h"
#include "motion/motion.h"

#include <ctype.h>
#include <errno.h>
#include <ini.h>
#include <stdio.h>
#include <string.h>

struct script_reader {
    struct motion_script *script;
    struct error *err;
    enum result result; // of the first entry that was refused
    unsigned seen;      // bit i: number_keys[i] was given
    bool seed_seen, unreachable_seen;
};

struct script_key {
    const char *key;
    size_t offset; // in struct motion_script
    double low, high;
};

static const struct script_key number_keys[] = {
    {"rate_hz", offsetof(struct motion_script, rate_hz), 10, 1000},
    {"speed_mm_s", offsetof(struct motion_script, speed_mm_s), 1, 200},
    {"joint_speed_deg_s", offsetof(struct motion_script, joint_speed_deg_s), 1, 90},
    {"tremor_mm", offsetof(struct motion_script, tremor_mm), 0, 2},
    {"optic_deg", offsetof(struct motion_script, optic_deg), 0, 90},
};

#define PLACE_IS ", a place being X Y Z or LANDMARK [X Y Z]"

static const struct {
    const char *key, *value;
} verbs[MOTION_VERB_COUNT] = {
    [MOTION_APPROACH] = {"approach", "INSTRUMENT PORTAL"},
    [MOTION_PALPATE] = {"palpate", "GROUP PLACE PLACE" PLACE_IS},
    [MOTION_FLEX] = {"flex", "DEGREES from 0 to 140"},
    [MOTION_VALGUS] = {"valgus", "DEGREES from -15 to 15"},
    [MOTION_DRAWER] = {"drawer", "MM from -10 to 10"},
    [MOTION_BITE] = {"bite", "INSTRUMENT GROUP [PLACE]" PLACE_IS},
    [MOTION_RESECT] = {"resect", "punch GROUP BITES from 1 to 100"},
    [MOTION_TRACE] = {"trace", "probe or shaver, and GROUP"},
    [MOTION_LOOK] = {"look", "GROUP [PLACE]" PLACE_IS},
    [MOTION_STAND] = {"stand", "GROUP PLACE PLACE" PLACE_IS},
    [MOTION_TURN] = {"turn", "GROUP PLACE" PLACE_IS},
    [MOTION_TOUCH] = {"touch", "INSTRUMENT GROUP PLACE" PLACE_IS},
    [MOTION_TAKE] = {"take", "INSTRUMENT LOOSE"},
    [MOTION_WAIT] = {"wait", "SECONDS from 0 to 60"},
    [MOTION_WITHDRAW] = {"withdraw", "INSTRUMENT"},
};

const char *motion_verb_name(enum motion_verb verb) {
    return verbs[verb].key;
}

static enum result read_unreachable(struct script_reader *r, const char *value) {
    if (r->unreachable_seen)
        return fail(r->err, RESULT_INVALID, "[motion] unreachable: given twice");
    r->unreachable_seen = true;
    r->script->skips = strcmp(value, "skip") == 0;
    if (r->script->skips || strcmp(value, "refuse") == 0)
        return RESULT_OK;
    return fail(r->err, RESULT_INVALID, "[motion] unreachable = %s: must be refuse or skip", value);
}

static enum result read_setting(struct script_reader *r, const char *key, const char *value) {
    if (strcmp(key, "seed") == 0) {
        if (r->seed_seen)
            return fail(r->err, RESULT_INVALID, "[motion] seed: given twice");
        r->seed_seen = true;
        if (number_int(value, 0, UINT32_MAX, &r->script->seed))
            return RESULT_OK;
        return fail(r->err, RESULT_INVALID, "[motion] seed = %s: must be a number from 0 to %u",
                    value, UINT32_MAX);
    }
    if (strcmp(key, "unreachable") == 0)
        return read_unreachable(r, value);
    for (unsigned i = 0; i < sizeof number_keys / sizeof *number_keys; i++) {
        const struct script_key *k = &number_keys[i];
        if (strcmp(key, k->key) != 0)
            continue;
        if (r->seen >> i & 1)
            return fail(r->err, RESULT_INVALID, "[motion] %s: given twice", key);
        r->seen |= 1u << i;
        if (number_double(value, k->low, k->high, (double *)((char *)r->script + k->offset)))
            return RESULT_OK;
        return fail(r->err, RESULT_INVALID, "[motion] %s = %s: must be a number from %g to %g", key,
                    value, k->low, k->high);
    }
    return fail(r->err, RESULT_INVALID, "[motion] %s: unknown key", key);
}

#define WORDS_MAX 9

static int split(char *text, const char *words[WORDS_MAX]) {
    int count = 0;
    char *rest;
    for (char *w = strtok_r(text, " \t", &rest); w; w = strtok_r(NULL, " \t", &rest)) {
        if (count == WORDS_MAX)
            return WORDS_MAX + 1;
        words[count++] = w;
    }
    return count;
}

static bool read_tool(const char *word, enum channel *out_tool) {
    return channel_from_name(word, out_tool) && *out_tool >= CHANNEL_FIRST_INSTRUMENT;
}

static bool read_name(const char *word, char name[CASE_NAME_MAX]) {
    return snprintf(name, CASE_NAME_MAX, "%s", word) < CASE_NAME_MAX;
}

static bool read_point(const char *const *words, int count, vec3 *out_point) {
    return count >= 3 && number_double(words[0], -1000, 1000, &out_point->x) &&
           number_double(words[1], -1000, 1000, &out_point->y) &&
           number_double(words[2], -1000, 1000, &out_point->z);
}

// How many of the words the place takes; 0: they are none.
static int read_place(const char *const *words, int count, struct motion_place *out_place) {
    *out_place = (struct motion_place){0};
    if (count == 0)
        return 0;
    if (!isalpha((unsigned char)*words[0]))
        return read_point(words, count, &out_place->at) ? 3 : 0;
    if (!case_name_is_valid(words[0]) || !read_name(words[0], out_place->landmark))
        return 0;
    return read_point(words + 1, count - 1, &out_place->at) ? 4 : 1;
}

// The group, and as many places as there must be.
static bool read_places(struct motion_step *step, const char *const *words, int count,
                        int place_count) {
    if (count == 0 || !read_name(words[0], step->name))
        return false;
    int used = 1;
    for (int i = 0; i < place_count; i++) {
        int taken = read_place(words + used, count - used, i ? &step->to : &step->from);
        if (taken == 0)
            return false;
        used += taken;
    }
    step->has_place = place_count > 0;
    return used == count;
}

static const double touch_seconds = 1;

static bool read_words(struct motion_step *step, const char *const *words, int count) {
    switch (step->verb) {
    case MOTION_APPROACH:
        return count == 2 && read_tool(words[0], &step->tool) && read_name(words[1], step->name);
    case MOTION_TAKE:
        return count == 2 && read_tool(words[0], &step->tool) && read_name(words[1], step->name);
    case MOTION_WITHDRAW:
        return count == 1 && read_tool(words[0], &step->tool);
    case MOTION_FLEX:
        return count == 1 && number_double(words[0], 0, 140, &step->amount);
    case MOTION_VALGUS:
        return count == 1 && number_double(words[0], -15, 15, &step->amount);
    case MOTION_DRAWER:
        return count == 1 && number_double(words[0], -10, 10, &step->amount);
    case MOTION_PALPATE:
        step->tool = CHANNEL_PROBE;
        return read_places(step, words, count, 2);
    case MOTION_BITE:
        return count > 0 && read_tool(words[0], &step->tool) &&
               read_places(step, words + 1, count - 1, count > 2);
    case MOTION_RESECT:
        return count == 3 && read_tool(words[0], &step->tool) && step->tool == CHANNEL_PUNCH &&
               read_name(words[1], step->name) && number_int(words[2], 1, 100, &step->count);
    case MOTION_TRACE:
        return count == 2 && read_tool(words[0], &step->tool) && read_name(words[1], step->name) &&
               (step->tool == CHANNEL_PROBE || step->tool == CHANNEL_SHAVER);
    case MOTION_LOOK:
        step->tool = CHANNEL_SCOPE;
        return read_places(step, words, count, count > 1);
    case MOTION_STAND:
    case MOTION_TURN:
        step->tool = CHANNEL_SCOPE;
        return read_places(step, words, count, step->verb == MOTION_STAND ? 2 : 1);
    case MOTION_TOUCH:
        step->amount = touch_seconds;
        return count > 2 && read_tool(words[0], &step->tool) &&
               read_places(step, words + 1, count - 1, 1);
    case MOTION_WAIT:
        return count == 1 && number_double(words[0], 0, 60, &step->amount);
    default:
        return false;
    }
}

static enum motion_verb verb_from_key(const char *key) {
    enum motion_verb verb = 0;
    while (verb < MOTION_VERB_COUNT && strcmp(verbs[verb].key, key) != 0)
        verb++;
    return verb;
}

static enum result read_step(struct script_reader *r, const char *key, const char *value) {
    struct motion_script *script = r->script;
    struct motion_step step = {.verb = verb_from_key(key)};
    if (step.verb == MOTION_VERB_COUNT)
        return fail(r->err, RESULT_INVALID, "[steps] %s: unknown key", key);
    if (script->step_count == MOTION_STEPS_MAX)
        return fail(r->err, RESULT_LIMIT, "[steps] more than %d steps", MOTION_STEPS_MAX);
    char text[256];
    const char *words[WORDS_MAX];
    snprintf(text, sizeof text, "%s", value);
    int count = split(text, words);
    if (count > WORDS_MAX || !read_words(&step, words, count))
        return fail(r->err, RESULT_INVALID, "[steps] %s = %s: must be %s", key, value,
                    verbs[step.verb].value);
    script->steps[script->step_count++] = step;
    return RESULT_OK;
}

// inih goes on after an error: only the first one counts.
static int read_entry(void *user, const char *section, const char *key, const char *value) {
    struct script_reader *r = user;
    if (r->result != RESULT_OK)
        return 0;
    if (strcmp(section, "motion") == 0)
        r->result = read_setting(r, key, value);
    else if (strcmp(section, "steps") == 0)
        r->result = read_step(r, key, value);
    else
        r->result = fail(r->err, RESULT_INVALID, "[%s]: unknown section", section);
    return r->result == RESULT_OK;
}

enum result motion_script_load(const char *path, struct motion_script *out_script,
                               struct error *err) {
    *out_script = (struct motion_script){.rate_hz = 100,
                                         .speed_mm_s = 40,
                                         .joint_speed_deg_s = 20,
                                         .seed = 1,
                                         .optic_deg = MOTION_OPTIC_DEG};
    struct script_reader r = {.script = out_script, .err = err, .result = RESULT_OK};
    int line = ini_parse(path, read_entry, &r);
    if (line < 0)
        return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    if (r.result != RESULT_OK)
        return fail_in(err, r.result, "%s:%d: ", path, line);
    if (line > 0)
        return fail(err, RESULT_FORMAT, "%s:%d: neither a section nor a key with a value", path,
                    line);
    if (out_script->step_count == 0)
        return fail(err, RESULT_MISSING, "%s: [steps] has no step", path);
    return RESULT_OK;
}
