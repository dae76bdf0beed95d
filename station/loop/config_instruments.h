// [instrument NAME] in a station's config. For config.c only.
#pragma once

#include "base/instrument.h"
#include "settings/settings.h"

extern const struct setting_key instrument_keys[];

// Where the keys of a section go: an instrument behind those that are there, found again by its
// name. RESULT_LIMIT: there is no room, or the name is too long.
void *instrument_section(struct instruments *instruments, const char *name, struct error *err);

// After all keys: sizes that are not given become those of the kind. Checks all, and names the
// channels of those that are described. RESULT_MISSING: one has no kind.
enum result instruments_complete(struct instruments *instruments, struct error *err);
