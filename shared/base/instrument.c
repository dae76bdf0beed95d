#include "base/instrument.h"

#include <stddef.h>
#include <string.h>

const char *instrument_kind_name(enum instrument_kind kind) {
    static const char *const names[INSTRUMENT_KIND_COUNT] = {"tip", "jaw", "burr", "blade",
                                                             "optic"};
    return (unsigned)kind < INSTRUMENT_KIND_COUNT ? names[kind] : "unknown";
}

// The sizes of a kind: the usual one, and the least and the most that cuts are made for. All 0: the
// kind has no such size.
struct size {
    const char *name;
    size_t offset;
    double usual, least, most;
};

#define SIZE(member, usual, least, most)                                                           \
    { #member, offsetof(struct instrument, member), usual, least, most }
#define SIZES_MAX 3

static const struct kind_row {
    bool cuts;
    int button;
    struct size sizes[SIZES_MAX];
} kinds[INSTRUMENT_KIND_COUNT] = {
    [INSTRUMENT_TIP] = {false, -1, {{0}}},
    [INSTRUMENT_JAW] = {true,
                        -1,
                        {SIZE(length_mm, 6, 2, 30), SIZE(width_mm, 3.5, 0.5, 20),
                         SIZE(opening_deg, 35, 5, 90)}},
    [INSTRUMENT_BURR] = {true, 0, {SIZE(width_mm, 4, 1, 12)}},
    [INSTRUMENT_BLADE] = {true,
                          -1,
                          {SIZE(length_mm, 3.5, 1, 30), SIZE(width_mm, 2.5, 0.5, 20),
                           SIZE(thickness_mm, 0.2, 0.1, 2)}},
    [INSTRUMENT_OPTIC] = {false, -1, {{0}}},
};

static double *size_in(struct instrument *instrument, const struct size *size) {
    return (double *)((char *)instrument + size->offset);
}

struct instrument instrument_of_kind(enum instrument_kind kind) {
    const struct kind_row *row = &kinds[kind];
    struct instrument out = {
        .kind = kind, .cuts = row->cuts, .button = row->button, .colour = INSTRUMENT_PLAIN};
    for (int i = 0; i < SIZES_MAX && row->sizes[i].name; i++)
        *size_in(&out, &row->sizes[i]) = row->sizes[i].usual;
    return out;
}

// As instrument_of_kind gives them; a test compares the two.
#define THE_FIVE                                                                                   \
    {"probe", INSTRUMENT_TIP, false, -1, 0, 0, 0, 0, INSTRUMENT_PLAIN},                            \
        {"punch", INSTRUMENT_JAW, true, -1, 6, 3.5, 0, 35, INSTRUMENT_PLAIN},                      \
        {"shaver", INSTRUMENT_BURR, true, 0, 0, 4, 0, 0, INSTRUMENT_PLAIN},                        \
        {"knife", INSTRUMENT_BLADE, true, -1, 3.5, 2.5, 0.2, 0, INSTRUMENT_PLAIN}, {               \
        "scope", INSTRUMENT_OPTIC, false, -1, 0, 0, 0, 0, INSTRUMENT_PLAIN                         \
    }

const struct instruments *instruments_usual(void) {
    static const struct instruments usual = {INSTRUMENTS_USUAL, {THE_FIVE}};
    return &usual;
}

const struct instruments *instruments_of_hands(void) {
    static const struct instruments hands = {
        INSTRUMENTS_USUAL + 1,
        {THE_FIVE, {"grasper", INSTRUMENT_JAW, false, -1, 10, 4, 0, 60, INSTRUMENT_PLAIN}}};
    return &hands;
}

struct instrument instrument_grasper(void) {
    return instruments_of_hands()->of[INSTRUMENTS_USUAL];
}

bool instrument_cuts(const struct instrument *instrument) {
    return kinds[instrument->kind].cuts && instrument->cuts;
}

double instrument_opening(const struct instrument *instrument, const struct handle *handle) {
    if (instrument->kind != INSTRUMENT_JAW || instrument->button < 0)
        return handle->opening;
    return handle->buttons >> instrument->button & 1 ? 0 : 1;
}

void instruments_name_channels(const struct instruments *instruments) {
    for (int i = INSTRUMENTS_USUAL; i < instruments->count; i++)
        channel_set_name((enum channel)(CHANNEL_FIRST_INSTRUMENT + i), instruments->of[i].name);
}

static bool one_equal(const struct instrument *a, const struct instrument *b) {
    return !strcmp(a->name, b->name) && a->kind == b->kind && a->cuts == b->cuts &&
           a->button == b->button && a->length_mm == b->length_mm && a->width_mm == b->width_mm &&
           a->thickness_mm == b->thickness_mm && a->opening_deg == b->opening_deg &&
           a->colour == b->colour;
}

bool instruments_equal(const struct instruments *a, const struct instruments *b) {
    bool equal = a->count == b->count;
    for (int i = 0; equal && i < a->count; i++)
        equal = one_equal(&a->of[i], &b->of[i]);
    return equal;
}

// ---- checks -------------------------------------------------------------------------------------

static bool name_is_good(const char *name) {
    static const char letters[] = "abcdefghijklmnopqrstuvwxyz";
    static const char all[] = "abcdefghijklmnopqrstuvwxyz0123456789-_";
    size_t length = strnlen(name, INSTRUMENT_NAME_MAX);
    return length > 0 && length < INSTRUMENT_NAME_MAX && strchr(letters, name[0]) &&
           strspn(name, all) == length;
}

// Whether `longer` is how tables, scenes and recordings call something of `name`.
static bool is_derived(const char *longer, const char *name) {
    size_t length = strlen(name);
    return !strncmp(longer, name, length) &&
           (!strcmp(longer + length, "_warped") || !strcmp(longer + length, "_handle"));
}

static bool name_is_taken(const struct instruments *instruments, const char *name) {
    static const char *const others[] = {"virtual_", "mockup_", "torn_"};
    for (size_t i = 0; i < sizeof others / sizeof *others; i++)
        if (!strncmp(name, others[i], strlen(others[i])))
            return true;
    for (int i = 0; i < instruments->count; i++) {
        const char *other = instruments->of[i].name;
        if (!strcmp(other, name) || is_derived(name, other) || is_derived(other, name))
            return true;
    }
    return channel_is_reserved(name);
}

static const struct size *size_of(enum instrument_kind kind, size_t offset) {
    const struct size *sizes = kinds[kind].sizes;
    for (int i = 0; i < SIZES_MAX && sizes[i].name; i++)
        if (sizes[i].offset == offset)
            return &sizes[i];
    return NULL;
}

// NaN is in no range, and not 0.
static enum result check_size(const struct instrument *instrument, size_t offset, const char *name,
                              struct error *err) {
    const struct size *size = size_of(instrument->kind, offset);
    const char *kind = instrument_kind_name(instrument->kind);
    double value = *(const double *)((const char *)instrument + offset);
    if (!size && value != 0)
        return fail(err, RESULT_INVALID, "instrument %s: %s is nothing of a %s", instrument->name,
                    name, kind);
    if (size && !(value >= size->least && value <= size->most))
        return fail(err, RESULT_INVALID, "instrument %s: %s of a %s is from %g to %g",
                    instrument->name, name, kind, size->least, size->most);
    return RESULT_OK;
}

static enum result check_sizes(const struct instrument *instrument, struct error *err) {
    static const struct {
        const char *name;
        size_t offset;
    } all[] = {{"length_mm", offsetof(struct instrument, length_mm)},
               {"width_mm", offsetof(struct instrument, width_mm)},
               {"thickness_mm", offsetof(struct instrument, thickness_mm)},
               {"opening_deg", offsetof(struct instrument, opening_deg)}};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        if (check_size(instrument, all[i].offset, all[i].name, err) != RESULT_OK)
            return RESULT_INVALID;
    return RESULT_OK;
}

static enum result check_handle(const struct instrument *instrument, struct error *err) {
    int least = instrument->kind == INSTRUMENT_BURR ? 0 : -1;
    bool has_button = instrument->kind == INSTRUMENT_BURR || instrument->kind == INSTRUMENT_JAW;
    if (instrument->button < least || instrument->button > (has_button ? 31 : -1))
        return fail(err, RESULT_INVALID, "instrument %s: a %s has no such button", instrument->name,
                    instrument_kind_name(instrument->kind));
    return RESULT_OK;
}

enum result instruments_add(struct instruments *instruments, const struct instrument *instrument,
                            struct error *err) {
    const char *name = instrument->name;
    if (!name_is_good(name))
        return fail(err, RESULT_INVALID,
                    "an instrument's name is 1 to %d of a-z, 0-9, - and _, after a letter",
                    INSTRUMENT_NAME_MAX - 1);
    if (instruments->count >= INSTRUMENT_COUNT)
        return fail(err, RESULT_LIMIT, "instrument %s: at most %d can be described", name,
                    INSTRUMENTS_DESCRIBED_MAX);
    if (name_is_taken(instruments, name))
        return fail(err, RESULT_INVALID, "instrument %s: the name is taken", name);
    if ((unsigned)instrument->kind >= INSTRUMENT_KIND_COUNT)
        return fail(err, RESULT_INVALID, "instrument %s: its kind is not known", name);
    if (instrument->colour != INSTRUMENT_PLAIN && instrument->colour > 0xffffff)
        return fail(err, RESULT_INVALID, "instrument %s: its colour is not 0 to ffffff", name);
    if (check_handle(instrument, err) != RESULT_OK || check_sizes(instrument, err) != RESULT_OK)
        return RESULT_INVALID;
    struct instrument *out = &instruments->of[instruments->count++];
    *out = *instrument;
    out->cuts = kinds[instrument->kind].cuts && instrument->cuts;
    return RESULT_OK;
}
