#include "drivers/modbus_edges.h"

#include "base/number.h"
#include "drivers/options.h"

#include <stdio.h>
#include <string.h>

enum { ADDRESSES = 65536, EDGE_TEXT_MAX = 64 };

static const char *const kind_words[] = {"coil ", "input ", "register "};
enum { REGISTER_WORD = MODBUS_BITS_COUNT, WORDS };

// ---- config -------------------------------------------------------------------------------------

static bool parse_bit(char *text, int first, struct modbus_edge *out) {
    int64_t bit;
    out->edge.each = edge_take_both(text);
    if (!number_int(text, first, first + ADDRESSES - 1, &bit))
        return false;
    out->bit = (int)bit - first;
    return true;
}

static bool parse(const char *text, const struct modbus_numbering *numbering,
                  struct modbus_edge *out) {
    char rest[EDGE_TEXT_MAX];
    int word = 0;
    while (word < WORDS && strncmp(text, kind_words[word], strlen(kind_words[word])) != 0)
        word++;
    if (word == WORDS || strlen(text) >= sizeof rest)
        return false;
    strcpy(rest, text + strlen(kind_words[word]));
    out->kind = (enum modbus_bits)word;
    out->is_register = word == REGISTER_WORD;
    if (!out->is_register)
        return parse_bit(rest, numbering->first ? 1 : 0, out);
    out->edge.each = true;
    out->in = (struct modbus_value){.kind = MODBUS_UNSIGNED, .bits = 16};
    return modbus_value_parse(rest, numbering, &out->in);
}

static enum result add_edge(struct modbus_edges *e, const struct device_config *config,
                            const struct device_option *option,
                            const struct modbus_numbering *numbering, struct error *err) {
    struct modbus_edge *edge = &e->all[e->count];
    if (e->count == EDGES_MAX)
        return option_fail(config, option->key, err, RESULT_LIMIT,
                           "a device has at most %d markers", EDGES_MAX);
    enum result result = edge_init(&edge->edge, config, option->key, err);
    if (result != RESULT_OK)
        return result;
    if (!parse(option->value, numbering, edge))
        return option_fail(config, option->key, err, RESULT_INVALID,
                           "\"%s\" is none of coil N [both], input N [both] and register REGISTER "
                           "[SCALE [OFFSET]] [TYPE], registers counted from %d, coils and inputs "
                           "from %d",
                           option->value, numbering->first, numbering->first ? 1 : 0);
    e->count++;
    return edge_check(&edge->edge, config, option->key, err);
}

// One request for all coils, and one for all inputs.
static enum result find_blocks(struct modbus_edges *e, const struct device_config *config,
                               const struct modbus_request *request, struct error *err) {
    for (int i = 0; i < e->count; i++) {
        const struct modbus_edge *edge = &e->all[i];
        struct modbus_request *r = &e->requests[edge->kind % MODBUS_BITS_COUNT];
        if (edge->is_register)
            continue;
        int low = !r->count || edge->bit < r->first ? edge->bit : r->first;
        int end = edge->bit + 1 > r->first + r->count ? edge->bit + 1 : r->first + r->count;
        *r = *request;
        r->bits = true;
        r->input = edge->kind == MODBUS_INPUTS;
        r->first = low;
        r->count = end - low;
        if (r->count > MODBUS_EDGE_BITS_MAX)
            return fail(err, RESULT_LIMIT,
                        "[device %s]: the markers of coils, or of inputs, are too far apart: one "
                        "reading has at most %d",
                        config->name, MODBUS_EDGE_BITS_MAX);
    }
    return RESULT_OK;
}

enum result modbus_edges_read(const struct device_config *config,
                              const struct modbus_numbering *numbering,
                              const struct modbus_request *request, struct modbus_edges *out,
                              struct error *err) {
    *out = (struct modbus_edges){0};
    for (int i = 0; i < config->option_count; i++) {
        enum result result = edge_key(&config->options[i])
                                 ? add_edge(out, config, &config->options[i], numbering, err)
                                 : RESULT_OK;
        if (result != RESULT_OK)
            return result;
    }
    return find_blocks(out, config, request, err);
}

void modbus_edges_widen(const struct modbus_edges *e, int *low, int *high) {
    for (int i = 0; i < e->count; i++) {
        const struct modbus_value *in = &e->all[i].in;
        int last = in->address + modbus_value_words(in) - 1;
        if (!e->all[i].is_register)
            continue;
        *low = in->address < *low ? in->address : *low;
        *high = last > *high ? last : *high;
    }
}

// ---- readings -----------------------------------------------------------------------------------

void modbus_edges_begin(struct modbus_edges *e) {
    for (int i = 0; i < e->count; i++)
        edge_begin(&e->all[i].edge);
}

void modbus_edges_see_registers(struct modbus_edges *e, enum modbus_order order, int first,
                                const uint16_t *registers, int64_t time_ns,
                                struct device_reading *reading) {
    for (int i = 0; i < e->count; i++) {
        struct modbus_edge *edge = &e->all[i];
        if (edge->is_register)
            edge_see(&edge->edge,
                     modbus_value_number(&edge->in, order, registers + edge->in.address - first),
                     time_ns, reading);
    }
}

void modbus_edges_see_bits(struct modbus_edges *e, enum modbus_bits kind, const uint16_t *bits,
                           int64_t time_ns, struct device_reading *reading) {
    for (int i = 0; i < e->count; i++) {
        struct modbus_edge *edge = &e->all[i];
        if (!edge->is_register && edge->kind == kind)
            edge_see(&edge->edge, bits[edge->bit - e->requests[kind].first], time_ns, reading);
    }
}
