#include "igtl/metadata.h"

#include "igtl/big_endian.h"

#include <string.h>

enum { COUNT_SIZE = 2, ENTRY_SIZE = 8, VALUE_SIZE_AT = 4, CUT_SIZE = IGTL_DEVICE_SIZE - 1 };

enum result igtl_entries_begin(const struct igtl_content *c, struct igtl_entries *out,
                               struct error *err) {
    *out = (struct igtl_entries){0};
    if (c->index_size < COUNT_SIZE)
        return RESULT_OK;
    size_t count = (size_t)big_endian_get(c->index, COUNT_SIZE), size = 0;
    *out = (struct igtl_entries){c->index + COUNT_SIZE, (const char *)c->index + c->index_size,
                                 (int)count};
    if (count * ENTRY_SIZE > c->index_size - COUNT_SIZE)
        return fail(err, RESULT_FORMAT, "%zu entries of metadata in an index of %zu bytes", count,
                    c->index_size);
    for (size_t i = 0; i < count; i++) {
        const uint8_t *entry = out->index + i * ENTRY_SIZE;
        size += (size_t)(big_endian_get(entry, 2) + big_endian_get(entry + VALUE_SIZE_AT, 4));
    }
    if (size > c->metadata_size)
        return fail(err, RESULT_FORMAT, "%zu bytes of metadata in %zu", size, c->metadata_size);
    return RESULT_OK;
}

bool igtl_entries_next(struct igtl_entries *e, struct igtl_text *out_key,
                       struct igtl_text *out_value) {
    if (!e->left)
        return false;
    e->left--;
    *out_key = (struct igtl_text){e->text, (size_t)big_endian_get(e->index, 2)};
    *out_value = (struct igtl_text){e->text + out_key->size,
                                    (size_t)big_endian_get(e->index + VALUE_SIZE_AT, 4)};
    e->text = out_value->bytes + out_value->size;
    e->index += ENTRY_SIZE;
    return true;
}

// ---- tools --------------------------------------------------------------------------------------

static bool is_text(struct igtl_text a, const char *b) {
    return a.size == strlen(b) && !memcmp(a.bytes, b, a.size);
}

// True: it is more than the ending, which is cut off.
static bool take_ending(struct igtl_text *name, const char *ending) {
    size_t size = strlen(ending);
    if (name->size <= size || memcmp(name->bytes + name->size - size, ending, size) != 0)
        return false;
    name->size -= size;
    return true;
}

static bool is_called(const char *tool, struct igtl_text name) {
    size_t size = strlen(tool);
    return (size == name.size || (size == CUT_SIZE && name.size > size)) &&
           !memcmp(tool, name.bytes, size);
}

bool igtl_is_same_tool(const char *a, const char *b) {
    return is_called(a, (struct igtl_text){b, strlen(b)}) ||
           is_called(b, (struct igtl_text){a, strlen(a)});
}

static void set_name(struct igtl_tool *tool, struct igtl_text name) {
    size_t size = name.size < sizeof tool->name ? name.size : sizeof tool->name - 1;
    if (memchr(name.bytes, 0, size))
        return;
    memcpy(tool->name, name.bytes, size);
    tool->name[size] = 0;
}

// -1: it is no number of a tool.
static int number_of(struct igtl_text value) {
    int number = 0;
    for (size_t i = 0; i < value.size; i++) {
        if (value.bytes[i] < '0' || value.bytes[i] > '9' || number > IGTL_TOOLS_MAX)
            return -1;
        number = 10 * number + value.bytes[i] - '0';
    }
    return value.size ? number : -1;
}

static void take_name(struct igtl_message *m, struct igtl_text key, struct igtl_text value) {
    if (!m->names_tools) {
        if (is_text(key, "IGTL_DEVICE_NAME") && is_called(m->tools[0].name, value))
            set_name(&m->tools[0], value);
        return;
    }
    int at = number_of(value);
    if (take_ending(&key, "Index") && at >= 0 && at < m->count && is_called(m->tools[at].name, key))
        set_name(&m->tools[at], key);
}

static void take_state(struct igtl_message *m, struct igtl_text key, struct igtl_text value) {
    if (is_text(value, "OK"))
        return;
    if (!m->names_tools) {
        m->tools[0].unseen |= is_text(key, "TransformStatus");
        return;
    }
    if (!take_ending(&key, "Status"))
        return;
    for (int i = 0; i < m->count; i++)
        m->tools[i].unseen |= is_called(m->tools[i].name, key);
}

enum result igtl_read_tool_metadata(const struct igtl_content *content, struct igtl_message *m,
                                    struct error *err) {
    struct igtl_entries entries, again;
    struct igtl_text key, value;
    if (igtl_entries_begin(content, &entries, err) != RESULT_OK)
        return RESULT_FORMAT;
    again = entries;
    while (m->count && igtl_entries_next(&entries, &key, &value))
        take_name(m, key, value);
    while (m->count && igtl_entries_next(&again, &key, &value))
        take_state(m, key, value);
    return RESULT_OK;
}
