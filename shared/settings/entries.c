#include "settings/entries.h"

#include "base/check.h"

#include <ctype.h>
#include <errno.h>
#include <ini.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define SECTION_MAX 49 // bytes that inih keeps
#define ENTRIES_MAX 65536
#define LISTS 16384

// A section's header (key NULL) or one of its keys.
struct entry {
    char *section, *key;
    int line;
    int next; // in its list, by the hash of both; 0: none. Entries are counted from 1
};

struct entries_reader {
    FILE *file;
    entry_taker take;
    void *user;
    struct error *err;
    bool refused;
    bool continued; // the present line begins with a blank
    int line;
    int count;
    struct entry *entries; // the room is for a power of two
    int lists[LISTS];
};

static bool refuse(struct entries_reader *r) {
    r->refused = true;
    return false;
}

static bool same(const char *a, const char *b) {
    return a && b ? !strcmp(a, b) : a == b;
}

// FNV-1a.
static uint32_t hash_on(uint32_t hash, const char *text) {
    for (; *text; text++)
        hash = (hash ^ (uint8_t)*text) * 16777619u;
    return hash;
}

static int *list_of(struct entries_reader *r, const char *section, const char *key) {
    uint32_t hash = hash_on(hash_on(2166136261u, section), key ? key : "]");
    return &r->lists[hash % LISTS];
}

static const struct entry *find(struct entries_reader *r, const char *section, const char *key) {
    int at = *list_of(r, section, key);
    for (; at; at = r->entries[at - 1].next)
        if (same(r->entries[at - 1].section, section) && same(r->entries[at - 1].key, key))
            return &r->entries[at - 1];
    return NULL;
}

static bool remember(struct entries_reader *r, const char *section, const char *key) {
    if (r->count == ENTRIES_MAX) {
        fail(r->err, RESULT_LIMIT, "more than %d sections and keys", ENTRIES_MAX);
        return refuse(r);
    }
    if ((r->count & (r->count - 1)) == 0)
        r->entries =
            alloc_resize(r->entries, r->count ? 2 * (size_t)r->count : 1, sizeof *r->entries);
    int *list = list_of(r, section, key);
    r->entries[r->count++] =
        (struct entry){alloc_text(section), key ? alloc_text(key) : NULL, r->line, *list};
    *list = r->count;
    return true;
}

static bool take_header(struct entries_reader *r, const char *header) {
    char section[256];
    size_t length = strcspn(header, "]");
    if (header[length] != ']')
        return true; // inih says that it is no entry
    if (length > SECTION_MAX) {
        fail(r->err, RESULT_LIMIT, "the name of the section is longer than %d bytes", SECTION_MAX);
        return refuse(r);
    }
    memcpy(section, header, length);
    section[length] = '\0';
    const struct entry *first = find(r, section, NULL);
    if (!first)
        return remember(r, section, NULL);
    fail(r->err, RESULT_INVALID, "[%s] begins again; it began in line %d. Join the two", section,
         first->line);
    return refuse(r);
}

static bool is_cut(const struct entries_reader *r, const char *text, size_t size) {
    size_t length = strlen(text);
    return length + 1 == size && text[length - 1] != '\n' && !feof(r->file);
}

// As fgets, for inih.
static char *read_line(char *text, int size, void *user) {
    struct entries_reader *r = user;
    if (r->refused || !fgets(text, size, r->file))
        return NULL;
    r->line++;
    r->continued = isspace((unsigned char)text[0]);
    if (is_cut(r, text, (size_t)size)) {
        fail(r->err, RESULT_LIMIT, "longer than %d bytes", size - 2);
        refuse(r);
    } else if (text[strspn(text, " \t")] == '[') {
        take_header(r, text + strspn(text, " \t") + 1);
    }
    return r->refused ? NULL : text;
}

// To inih a line that begins with a blank goes on with the value before: it gives the key again.
static bool is_new(struct entries_reader *r, const char *section, const char *key) {
    const struct entry *first = find(r, section, key);
    if (!first)
        return remember(r, section, key);
    if (r->continued && first == &r->entries[r->count - 1])
        fail(r->err, RESULT_INVALID,
             "begins with a blank, so it goes on with the value of \"%s\". Remove the blank", key);
    else
        fail(r->err, RESULT_INVALID, "[%s] %s is given again; line %d gives it too", section, key,
             first->line);
    return refuse(r);
}

static int on_entry(void *user, const char *section, const char *key, const char *value) {
    struct entries_reader *r = user;
    if (r->refused || !is_new(r, section, key))
        return 0;
    return r->take(r->user, section, key, value, r->err) || refuse(r);
}

static enum result read_file(struct entries_reader *r, const char *path) {
    int wrong_line = ini_parse_stream(read_line, r, on_entry, r);
    if (ferror(r->file))
        return fail(r->err, RESULT_MISSING, "%s cannot be read: %s", path, strerror(errno));
    if (r->refused && (wrong_line <= 0 || r->line <= wrong_line))
        return fail_in(r->err, RESULT_INVALID, "%s: line %d: ", path, r->line);
    if (wrong_line)
        return fail(r->err, RESULT_FORMAT, "%s: line %d is neither [section] nor key = value", path,
                    wrong_line);
    return RESULT_OK;
}

static enum result read_from(FILE *file, const char *path, entry_taker take, void *user,
                             struct error *err) {
    if (!file)
        return fail(err, RESULT_MISSING, "%s cannot be read: %s", path, strerror(errno));
    struct entries_reader *r = alloc(1, sizeof *r);
    *r = (struct entries_reader){.file = file, .take = take, .user = user, .err = err};
    enum result result = read_file(r, path);
    fclose(file);
    for (int i = 0; i < r->count; i++) {
        free(r->entries[i].section);
        free(r->entries[i].key);
    }
    free(r->entries);
    free(r);
    return result;
}

enum result entries_read(const char *path, entry_taker take, void *user, struct error *err) {
    return read_from(fopen(path, "re"), path, take, user, err);
}

enum result entries_read_text(const char *path, const char *text, size_t size, entry_taker take,
                              void *user, struct error *err) {
    return read_from(fmemopen((void *)(uintptr_t)text, size, "r"), path, take, user, err);
}
