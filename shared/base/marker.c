#include "base/marker.h"

#include <math.h>
#include <string.h>

bool marker_name_is_valid(const char *name) {
    size_t length = strnlen(name, MARKER_TEXT_MAX);
    static const char usable[] =
        "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_.";
    return length > 0 && length < MARKER_TEXT_MAX && strspn(name, usable) == length;
}

static bool is_shown(const char *text) {
    size_t length = strnlen(text, MARKER_TEXT_MAX);
    for (size_t i = 0; i < length; i++)
        if ((unsigned char)text[i] < ' ' || text[i] == 0x7f)
            return false;
    return length > 0 && length < MARKER_TEXT_MAX;
}

bool marker_is_valid(const struct marker *marker) {
    return marker->number > 0 && isfinite(marker->value) && marker_name_is_valid(marker->name) &&
           is_shown(marker->device);
}
