#include "loop/config_instruments.h"

#include <stdlib.h>
#include <string.h>

#define NO_BUTTON (-2) // none is given

static const char *const instrument_kind_names[] = {"tip", "jaw", "burr", "blade", "optic", NULL};

static bool take_colour(void *target, const char *rest, const char *value) {
    (void)rest;
    struct instrument *instrument = target;
    value += value[0] == '#';
    if (strlen(value) != 6 || strspn(value, "0123456789abcdefABCDEF") != 6)
        return false;
    instrument->colour = (uint32_t)strtoul(value, NULL, 16);
    return true;
}

#define IN(member) SETTING_IN(struct instrument, member)

const struct setting_key instrument_keys[] = {
    {"kind", SETTING_CHOICE, IN(kind), .choices = instrument_kind_names},
    {"cuts", SETTING_SWITCH, IN(cuts)},
    {"button", SETTING_INTEGER, IN(button), 0, 31},
    {"length_mm", SETTING_NUMBER, IN(length_mm), 1, 30},
    {"width_mm", SETTING_NUMBER, IN(width_mm), 0.5, 20},
    {"thickness_mm", SETTING_NUMBER, IN(thickness_mm), 0.1, 2},
    {"opening_deg", SETTING_NUMBER, IN(opening_deg), 5, 90},
    {"colour", .take = take_colour, .wanted = "six hexadecimal digits, as #ffcc00"},
    {0},
};

void *instrument_section(struct instruments *instruments, const char *name, struct error *err) {
    for (int i = INSTRUMENTS_USUAL; i < instruments->count; i++)
        if (!strcmp(instruments->of[i].name, name))
            return &instruments->of[i];
    if (instruments->count == INSTRUMENT_COUNT) {
        fail(err, RESULT_LIMIT, "a station describes at most %d instruments",
             INSTRUMENTS_DESCRIBED_MAX);
        return NULL;
    }
    struct instrument *one = &instruments->of[instruments->count];
    if (!setting_text(name, one->name, sizeof one->name)) {
        fail(err, RESULT_LIMIT, "an instrument's name has at most %d bytes",
             INSTRUMENT_NAME_MAX - 1);
        return NULL;
    }
    one->kind = INSTRUMENT_KIND_COUNT;
    one->cuts = true;
    one->button = NO_BUTTON;
    one->colour = INSTRUMENT_PLAIN;
    instruments->count++;
    return one;
}

static void take_given(double *size, double given) {
    if (given > 0)
        *size = given;
}

static enum result complete_one(const struct instrument *given, struct instruments *out,
                                struct error *err) {
    if (given->kind == INSTRUMENT_KIND_COUNT)
        return fail(err, RESULT_MISSING, "[instrument %s] needs kind", given->name);
    struct instrument one = instrument_of_kind(given->kind);
    memcpy(one.name, given->name, sizeof one.name);
    one.cuts = given->cuts;
    one.colour = given->colour;
    if (given->button != NO_BUTTON)
        one.button = given->button;
    take_given(&one.length_mm, given->length_mm);
    take_given(&one.width_mm, given->width_mm);
    take_given(&one.thickness_mm, given->thickness_mm);
    take_given(&one.opening_deg, given->opening_deg);
    return instruments_add(out, &one, err);
}

enum result instruments_complete(struct instruments *instruments, struct error *err) {
    struct instruments out = *instruments_usual();
    for (int i = INSTRUMENTS_USUAL; i < instruments->count; i++) {
        enum result result = complete_one(&instruments->of[i], &out, err);
        if (result != RESULT_OK)
            return result;
    }
    *instruments = out;
    instruments_name_channels(instruments);
    return RESULT_OK;
}
