#include "store/text.h"

#include <stdint.h>
#include <string.h>

// The length of the UTF-8 character at `text`, or 0 if it is invalid (overlong or a surrogate).
static size_t character(const unsigned char *text, uint32_t *out_code) {
    static const uint32_t least[] = {0, 0, 0x80, 0x800, 0x10000};
    size_t length = text[0] < 0x80 ? 1 : text[0] < 0xc0 ? 0 : text[0] < 0xe0 ? 2 : 4;
    if ((text[0] & 0xf0) == 0xe0)
        length = 3;
    if (length == 0 || text[0] > 0xf4)
        return 0;
    uint32_t code = length == 1 ? text[0] : text[0] & (0x7fu >> length);
    for (size_t i = 1; i < length; i++) {
        if ((text[i] & 0xc0) != 0x80)
            return 0;
        code = code << 6 | (text[i] & 0x3f);
    }
    *out_code = code;
    bool good = code >= least[length] && code <= 0x10ffff && (code < 0xd800 || code > 0xdfff);
    return good ? length : 0;
}

static bool is_printable(const char *text) {
    uint32_t code;
    for (const unsigned char *at = (const unsigned char *)text; *at;) {
        size_t length = character(at, &code);
        if (!length || code < 0x20 || (code >= 0x7f && code < 0xa0))
            return false;
        at += length;
    }
    return true;
}

enum result text_check(const char *text, const char *what, size_t size, struct error *err) {
    if (!text[0])
        return fail(err, RESULT_INVALID, "the %s is empty", what);
    if (strlen(text) >= size)
        return fail(err, RESULT_INVALID, "the %s '%.20s...' is longer than %zu bytes", what, text,
                    size - 1);
    if (!is_printable(text))
        return fail(err, RESULT_INVALID, "the %s contains a character that is not printable UTF-8",
                    what);
    return RESULT_OK;
}
