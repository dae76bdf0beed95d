#include "base/number.h"
#include "web/answer.h"

#include <stdio.h>
#include <string.h>

// A number in decimal digits, up to `end`. -1: there is none. -2: there is something else.
static int64_t read_position(const char *text, const char *end) {
    char digits[20];
    int64_t value;
    size_t length = (size_t)(end - text);
    if (length == 0)
        return -1;
    if (length >= sizeof digits || strspn(text, "0123456789") < length)
        return -2;
    memcpy(digits, text, length);
    digits[length] = '\0';
    return number_int(digits, 0, INT64_MAX, &value) ? value : -2;
}

enum range_verdict range_parse(const char *range, int64_t size, int64_t *out_from,
                               int64_t *out_to) {
    static const char unit[] = "bytes=";
    *out_from = 0;
    *out_to = size;
    if (strncmp(range, unit, sizeof unit - 1))
        return RANGE_NONE;
    const char *text = range + sizeof unit - 1, *dash = strchr(text, '-');
    if (!dash)
        return RANGE_NONE;
    int64_t first = read_position(text, dash), last = read_position(dash + 1, strchr(dash, '\0'));
    if (first == -2 || last == -2 || (first == -1 && last == -1) || (last >= 0 && last < first))
        return RANGE_NONE;
    if (first >= 0) {
        *out_from = first;
        *out_to = last >= 0 && last < size ? last + 1 : size;
        return first < size ? RANGE_SOME : RANGE_BEYOND;
    }
    *out_from = last < size ? size - last : 0;
    return last > 0 && size > 0 ? RANGE_SOME : RANGE_BEYOND;
}
