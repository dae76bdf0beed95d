#include "base/nearest.h"
#include "base/number.h"
#include "settings/entries.h"
#include "settings/settings.h"

#include <limits.h>
#include <stdio.h>
#include <string.h>

#define NAMES_MAX 64 // of sections, or of keys of one

struct loading {
    char dir[PATH_MAX];
    const struct setting_section *sections;
    void *user;
};

// ---- names --------------------------------------------------------------------------------------

static void add_names(struct error *err, const char *before, const char *const *names,
                      const char *after) {
    char *end = err->text + strlen(err->text), *limit = err->text + sizeof err->text;
    for (int i = 0; names[i] && end < limit; i++)
        end += snprintf(end, (size_t)(limit - end), "%s%s%s", i ? ", " : before, names[i],
                        names[i + 1] ? "" : after);
}

// The one that was meant, where it can be guessed, else all of them.
static void add_hint(struct error *err, const char *meant, const char *before_all,
                     const char *const *names) {
    const char *const one[] = {meant, NULL};
    if (meant)
        add_names(err, "; did you mean ", one, "?");
    else
        add_names(err, before_all, names, "");
}

// The name that the file chose behind the section's own; NULL: it is another section.
static const char *name_in(const struct setting_section *section, const char *text) {
    size_t length = strcspn(section->name, " ");
    bool named = section->name[length];
    if (strncmp(text, section->name, length) || (text[length] != ' ') == named)
        return NULL;
    if (!named)
        return text[length] ? NULL : "";
    return text[length + 1] ? text + length + 1 : NULL;
}

// A section's own word counts, not the name that the file chose behind it.
static bool refuse_section(const struct setting_section *sections, const char *text,
                           struct error *err) {
    const char *heads[NAMES_MAX + 1] = {NULL}, *names[NAMES_MAX + 1] = {NULL};
    char head_texts[NAMES_MAX][64], name_texts[NAMES_MAX][64], word[64];
    for (int i = 0; sections[i].name && i < NAMES_MAX; i++) {
        int length = (int)strcspn(sections[i].name, " ");
        snprintf(head_texts[i], sizeof head_texts[i], "%.*s", length, sections[i].name);
        snprintf(name_texts[i], sizeof name_texts[i], "[%s]", sections[i].name);
        heads[i] = head_texts[i];
        names[i] = name_texts[i];
    }
    snprintf(word, sizeof word, "%.*s", (int)strcspn(text, " "), text);
    if (*text)
        fail(err, RESULT_INVALID, "there is no section [%s]", text);
    else
        fail(err, RESULT_INVALID, "no [section] stands before it");
    const char *nearest = nearest_name(word, heads), *meant = NULL;
    for (int i = 0; heads[i]; i++)
        meant = heads[i] == nearest ? names[i] : meant;
    add_hint(err, meant, "; the sections are ", names);
    return false;
}

static bool refuse_key(const struct setting_section *section, const char *section_text,
                       const char *key, struct error *err) {
    const char *names[NAMES_MAX + 1] = {NULL};
    for (int i = 0; section->keys[i].name && i < NAMES_MAX; i++)
        names[i] = section->keys[i].name;
    fail(err, RESULT_INVALID, "[%s] has no key \"%s\"", section_text, key);
    add_hint(err, nearest_name(key, names), "; its keys are ", names);
    return false;
}

static const struct setting_key *key_in(const struct setting_section *section, const char *key,
                                        const char **out_rest) {
    for (const struct setting_key *k = section->keys; k->name; k++) {
        size_t length = strlen(k->name);
        bool any = !strcmp(k->name, "*"), family = k->name[length - 1] == '.';
        *out_rest = any ? key : family ? key + length : "";
        if (any || (family ? !strncmp(key, k->name, length) : !strcmp(key, k->name)))
            return k;
    }
    return NULL;
}

// ---- values -------------------------------------------------------------------------------------

static bool take_choice(const struct setting_key *key, const char *value, int *out) {
    for (int i = 0; key->choices[i]; i++)
        if (!strcmp(key->choices[i], value)) {
            *out = i;
            return true;
        }
    return false;
}

static bool take_integer(const struct setting_key *key, const char *value, int *out) {
    int64_t number;
    if (!number_int(value, (int64_t)key->low, (int64_t)key->high, &number))
        return false;
    *out = (int)number;
    return true;
}

static bool take_value(const struct loading *l, const struct setting_key *key, void *target,
                       const char *rest, const char *value) {
    void *out = (char *)target + key->offset;
    switch (key->kind) {
    case SETTING_TEXT:
        return setting_text(value, out, key->size);
    case SETTING_PATH:
        return setting_path(l->dir, value, out, key->size);
    case SETTING_INTEGER:
        return take_integer(key, value, out);
    case SETTING_NUMBER:
        return number_double(value, key->low, key->high, out);
    case SETTING_SWITCH:
        return number_bool(value, out);
    case SETTING_CHOICE:
        return take_choice(key, value, out);
    default:
        return key->take(target, rest, value);
    }
}

static void say_wanted(const struct setting_key *key, const char *value, struct error *err) {
    char *end = err->text + strlen(err->text);
    size_t left = sizeof err->text - (size_t)(end - err->text);
    switch (key->kind) {
    case SETTING_TEXT:
    case SETTING_PATH:
        snprintf(end, left, *value ? "is too long" : "must not be empty");
        break;
    case SETTING_INTEGER:
        snprintf(end, left, "must be a whole number from %.0f to %.0f", key->low, key->high);
        break;
    case SETTING_NUMBER:
        snprintf(end, left, "must be a number from %g to %g", key->low, key->high);
        break;
    case SETTING_SWITCH:
        snprintf(end, left, "must be yes or no");
        break;
    case SETTING_CHOICE:
        snprintf(end, left, "is unknown");
        add_hint(err, nearest_name(value, key->choices), "; the choices are ", key->choices);
        break;
    default:
        snprintf(end, left, "must be %s", key->wanted);
    }
}

static bool take_table_entry(void *user, const char *section_text, const char *key_text,
                             const char *value, struct error *err) {
    const struct loading *l = user;
    const struct setting_section *section = l->sections;
    const char *name = NULL, *rest;
    while (section->name && !(name = name_in(section, section_text)))
        section++;
    if (!section->name)
        return refuse_section(l->sections, section_text, err);
    const struct setting_key *key = key_in(section, key_text, &rest);
    if (!key)
        return refuse_key(section, section_text, key_text, err);
    void *target = section->find(l->user, name, err);
    if (!target) {
        fail_in(err, RESULT_INVALID, "[%s]: ", section_text);
        return false;
    }
    if (take_value(l, key, target, rest, value))
        return true;
    fail(err, RESULT_INVALID, "[%s] %s = %s: ", section_text, key_text, value);
    say_wanted(key, value, err);
    return false;
}

enum result settings_load(const char *path, const struct setting_override *overrides,
                          int override_count, const struct setting_section *sections, void *user,
                          struct error *err) {
    struct loading l = {.sections = sections, .user = user};
    struct error unread; // what is wanted is added to the error's text
    err = err ? err : &unread;
    settings_folder(path, l.dir, sizeof l.dir);
    enum result result = entries_read(path, take_table_entry, &l, err);
    for (int i = 0; i < override_count && result == RESULT_OK; i++)
        if (!take_table_entry(&l, overrides[i].section, overrides[i].key, overrides[i].value, err))
            result = fail_in(err, RESULT_INVALID, "--set: ");
    return result;
}

enum result settings_load_text(const char *path, const char *text, size_t size,
                               const struct setting_section *sections, void *user,
                               struct error *err) {
    struct loading l = {.sections = sections, .user = user};
    struct error unread;
    settings_folder(path, l.dir, sizeof l.dir);
    return entries_read_text(path, text, size, take_table_entry, &l, err ? err : &unread);
}
