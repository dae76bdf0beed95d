#include "drivers/hid_descriptor.h"

#include "base/check.h"

#include <stdio.h>
#include <string.h>

enum { RANGES_MAX = 256, STACK_MAX = 8, DEPTH_MAX = 32, FIELD_BITS_MAX = 256 };
enum { TYPE_MAIN, TYPE_GLOBAL, TYPE_LOCAL, TYPE_RESERVED };
enum { MAIN_INPUT = 8, MAIN_OUTPUT, MAIN_COLLECTION, MAIN_FEATURE, MAIN_END_COLLECTION };
enum { FLAG_CONSTANT = 1, FLAG_VARIABLE = 2, FLAG_RELATIVE = 4 };
static const uint8_t long_item = 0xfe;

struct descriptor_item {
    int type, tag, size;
    uint32_t data;
    int32_t signed_data;
};

// Usages hold their page in the upper half; 0 there: the page that holds at the main item.
struct usage_range {
    uint32_t first, last;
};

struct globals {
    uint16_t page;
    int32_t low, high;
    uint32_t high_unsigned, size, count;
    uint8_t report;
};

struct parser {
    const uint8_t *bytes;
    size_t size, at, item_at;
    struct globals globals, stack[STACK_MAX];
    int stacked, depth;
    uint32_t collection; // the usage of the top-level one
    struct usage_range ranges[RANGES_MAX];
    int range_count;
    uint32_t first; // of a range whose end has not come
    int bits[256];  // of the input reports so far
    bool is_used, is_numbered;
    struct hid_descriptor *out;
};

static enum result refuse(const struct parser *p, enum result code, const char *why,
                          struct error *err) {
    return fail(err, code, "report descriptor, byte %zu: %s", p->item_at, why);
}

// ---- fields -------------------------------------------------------------------------------------

static uint32_t with_page(const struct parser *p, uint32_t usage) {
    return usage >> 16 ? usage : (uint32_t)p->globals.page << 16 | usage;
}

// Element i of a field has the i-th usage; the last one stands for all that follow.
static uint32_t usage_of(const struct parser *p, uint32_t i) {
    for (int r = 0; r < p->range_count; r++) {
        uint32_t count = p->ranges[r].last - p->ranges[r].first + 1;
        if (i < count)
            return with_page(p, p->ranges[r].first + i);
        i -= count;
    }
    return with_page(p, p->range_count ? p->ranges[p->range_count - 1].last : 0);
}

static void add_field(struct parser *p, uint32_t index, uint32_t flags, int bit) {
    const struct globals *g = &p->globals;
    uint32_t usage = usage_of(p, index);
    p->out->fields[p->out->count++] = (struct hid_descriptor_field){
        .collection_page = (uint16_t)(p->collection >> 16),
        .collection = (uint16_t)p->collection,
        .usage_page = (uint16_t)(usage >> 16),
        .usage = (uint16_t)usage,
        .place = {g->report, bit, (int)g->size},
        .low = g->low,
        .high = g->low < 0 ? g->high : (int64_t)g->high_unsigned,
        .is_relative = flags & FLAG_RELATIVE,
    };
}

static enum result check_input(struct parser *p, struct error *err) {
    const struct globals *g = &p->globals;
    if (!p->depth)
        return refuse(p, RESULT_FORMAT, "a field outside of every collection", err);
    if (p->is_used && p->is_numbered != (g->report != 0))
        return refuse(p, RESULT_FORMAT, "only some of the reports have a number", err);
    if (g->count && (!g->size || g->size > FIELD_BITS_MAX))
        return refuse(p, RESULT_FORMAT, "a field of 0 or more than 256 bits", err);
    if ((uint64_t)g->size * g->count + (uint64_t)p->bits[g->report] > 8 * HID_REPORT_BYTES_MAX)
        return refuse(p, RESULT_FORMAT, "a report of more than 4096 bytes", err);
    if (g->low < 0 ? g->high < g->low : g->high_unsigned < (uint32_t)g->low)
        return refuse(p, RESULT_FORMAT, "the logical maximum is below the minimum", err);
    return RESULT_OK;
}

static enum result take_input(struct parser *p, uint32_t flags, struct error *err) {
    const struct globals *g = &p->globals;
    enum result result = check_input(p, err);
    if (result != RESULT_OK)
        return result;
    p->is_used = true;
    p->is_numbered = g->report != 0;
    int *bits = &p->bits[g->report];
    bool is_wanted = !(flags & FLAG_CONSTANT) && flags & FLAG_VARIABLE && g->size <= 32;
    if (is_wanted && g->count > (uint32_t)(HID_FIELDS_MAX - p->out->count))
        return refuse(p, RESULT_LIMIT, "more than 1024 fields", err);
    for (uint32_t i = 0; i < g->count && is_wanted; i++)
        add_field(p, i, flags, *bits + (int)(i * g->size));
    *bits += (int)(g->size * g->count);
    return RESULT_OK;
}

// ---- items --------------------------------------------------------------------------------------

static enum result take_main(struct parser *p, const struct descriptor_item *item,
                             struct error *err) {
    enum result result = RESULT_OK;
    if (item->tag == MAIN_INPUT) {
        result = take_input(p, item->data, err);
    } else if (item->tag == MAIN_COLLECTION) {
        if (p->depth == DEPTH_MAX)
            return refuse(p, RESULT_FORMAT, "collections nested too deep", err);
        if (!p->depth++)
            p->collection = usage_of(p, 0);
    } else if (item->tag == MAIN_END_COLLECTION) {
        if (!p->depth--)
            return refuse(p, RESULT_FORMAT, "the end of a collection that did not begin", err);
    }
    p->range_count = 0;
    p->first = 0;
    return result;
}

static enum result push_or_pop(struct parser *p, bool push, struct error *err) {
    if (push ? p->stacked == STACK_MAX : !p->stacked)
        return refuse(p, RESULT_FORMAT, push ? "too many pushes" : "a pop without a push", err);
    if (push)
        p->stack[p->stacked++] = p->globals;
    else
        p->globals = p->stack[--p->stacked];
    return RESULT_OK;
}

static enum result take_global(struct parser *p, const struct descriptor_item *item,
                               struct error *err) {
    struct globals *g = &p->globals;
    switch (item->tag) {
    case 0:
        g->page = (uint16_t)item->data;
        return RESULT_OK;
    case 1:
        g->low = item->signed_data;
        return RESULT_OK;
    case 2: // signed only where the minimum is negative: 25 FF after 15 00 says 255
        g->high = item->signed_data;
        g->high_unsigned = item->data;
        return RESULT_OK;
    case 7:
        g->size = item->data;
        return RESULT_OK;
    case 8:
        if (item->data < 1 || item->data > 255)
            return refuse(p, RESULT_FORMAT, "a report's number that is not 1 to 255", err);
        g->report = (uint8_t)item->data;
        return RESULT_OK;
    case 9:
        g->count = item->data;
        return RESULT_OK;
    case 10:
    case 11:
        return push_or_pop(p, item->tag == 10, err);
    default: // physical bounds and units
        return RESULT_OK;
    }
}

static enum result take_local(struct parser *p, const struct descriptor_item *item,
                              struct error *err) {
    struct usage_range range = {item->data, item->data};
    if (item->tag == 1)
        p->first = item->data;
    if (item->tag != 0 && item->tag != 2) // designators, strings, delimiters
        return RESULT_OK;
    if (item->tag == 2)
        range.first = p->first;
    if (range.first > range.last)
        return refuse(p, RESULT_FORMAT, "the usage maximum is below the minimum", err);
    if (p->range_count == RANGES_MAX)
        return refuse(p, RESULT_LIMIT, "more than 256 usages for one item", err);
    p->ranges[p->range_count++] = range;
    return RESULT_OK;
}

static enum result next_item(struct parser *p, struct descriptor_item *out, struct error *err) {
    uint8_t prefix = p->bytes[p->at++];
    size_t left = p->size - p->at;
    *out = (struct descriptor_item){.type = TYPE_RESERVED};
    if (prefix == long_item) {
        if (left < 2 || left - 2 < p->bytes[p->at])
            return refuse(p, RESULT_FORMAT, "an item cut short", err);
        p->at += 2u + p->bytes[p->at];
        return RESULT_OK;
    }
    *out = (struct descriptor_item){prefix >> 2 & 3, prefix >> 4,
                                    (prefix & 3) == 3 ? 4 : prefix & 3, 0, 0};
    if (left < (size_t)out->size)
        return refuse(p, RESULT_FORMAT, "an item cut short", err);
    for (int i = 0; i < out->size; i++)
        out->data |= (uint32_t)p->bytes[p->at++] << 8 * i;
    out->signed_data = out->size == 1   ? (int8_t)out->data
                       : out->size == 2 ? (int16_t)out->data
                                        : (int32_t)out->data;
    return RESULT_OK;
}

static enum result take_item(struct parser *p, const struct descriptor_item *item,
                             struct error *err) {
    switch (item->type) {
    case TYPE_MAIN:
        return take_main(p, item, err);
    case TYPE_GLOBAL:
        return take_global(p, item, err);
    case TYPE_LOCAL:
        return take_local(p, item, err);
    default:
        return RESULT_OK;
    }
}

enum result hid_descriptor_read(const uint8_t *bytes, size_t size, struct hid_descriptor *out,
                                struct error *err) {
    struct parser p = {.bytes = bytes, .size = size, .out = out};
    enum result result = RESULT_OK;
    out->count = 0;
    if (size > HID_DESCRIPTOR_BYTES_MAX)
        return refuse(&p, RESULT_LIMIT, "more than 4096 bytes", err);
    while (p.at < size && result == RESULT_OK) {
        struct descriptor_item item;
        p.item_at = p.at;
        result = next_item(&p, &item, err);
        if (result == RESULT_OK)
            result = take_item(&p, &item, err);
    }
    p.item_at = p.at;
    if (result == RESULT_OK && p.depth)
        result = refuse(&p, RESULT_FORMAT, "it ends inside of a collection", err);
    return result;
}

// ---- a proposal ---------------------------------------------------------------------------------

static bool is_axis(const struct hid_descriptor_field *f) {
    bool desktop = f->usage_page == 0x01 && f->usage >= 0x30 && f->usage <= 0x38; // X to Wheel
    bool simulation = f->usage_page == 0x02, vendor = f->usage_page >= 0xff00;
    return (desktop || simulation || vendor) && !f->is_relative && f->place.count > 1 &&
           f->low < f->high;
}

static bool is_button(const struct hid_descriptor_field *f) {
    bool button = f->usage_page == 0x09, key = f->usage_page == 0x07;
    return (button || key) && f->place.count == 1;
}

static const struct hid_descriptor_field *
first_of(const struct hid_descriptor *descriptor, bool (*is)(const struct hid_descriptor_field *)) {
    for (int i = 0; i < descriptor->count; i++)
        if (is(&descriptor->fields[i]))
            return &descriptor->fields[i];
    return NULL;
}

// How many buttons lie side by side from `first` on.
static int buttons_in_row(const struct hid_descriptor *descriptor,
                          const struct hid_descriptor_field *first) {
    int count = 0, left = descriptor->count - (int)(first - descriptor->fields);
    while (count < left && count < 32 && is_button(&first[count]) &&
           first[count].place.report == first->place.report &&
           first[count].place.bit == first->place.bit + count)
        count++;
    return count;
}

static void place_text(const struct hid_field *place, int count, char out[32]) {
    if (place->report)
        snprintf(out, 32, "%u:%d %d", place->report, place->bit, count);
    else
        snprintf(out, 32, "%d %d", place->bit, count);
}

void hid_propose(const struct hid_descriptor *descriptor, enum channel channel,
                 char out_text[HID_PROPOSAL_BYTES_MAX]) {
    CHECK(channel >= CHANNEL_FIRST_INSTRUMENT && channel < CHANNEL_COUNT);
    const struct hid_descriptor_field *axis = first_of(descriptor, is_axis),
                                      *button = first_of(descriptor, is_button),
                                      *first = axis ? axis : button;
    const char *name = channel_name(channel);
    char place[32];
    int length = 0;
    out_text[0] = 0;
    if (first)
        length += snprintf(out_text, HID_PROPOSAL_BYTES_MAX, "usage = 0x%04x 0x%04x\n",
                           first->collection_page, first->collection);
    if (axis) {
        place_text(&axis->place, axis->place.count, place);
        length += snprintf(out_text + length, HID_PROPOSAL_BYTES_MAX - (size_t)length,
                           "%s.opening = %s %lld %lld\n", name, place, (long long)axis->low,
                           (long long)axis->high);
    }
    if (button) {
        place_text(&button->place, buttons_in_row(descriptor, button), place);
        snprintf(out_text + length, HID_PROPOSAL_BYTES_MAX - (size_t)length, "%s.buttons = %s\n",
                 name, place);
    }
}
