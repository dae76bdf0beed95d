// The tables, as steps from each version to the next.
#pragma once

#include <stdint.h>

#define STORE_APPLICATION_ID 0x4172746e // "Artn", in the file's header

// schema_steps[i] takes version i to i + 1. A step that was released is never changed.
extern const char *const schema_steps[];
extern const int schema_version; // of this program
