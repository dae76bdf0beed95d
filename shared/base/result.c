#include "base/result.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

const char *result_sentence(enum result result) {
    static const char *const sentences[RESULT_COUNT] = {
        [RESULT_OK] = "all is well",
        [RESULT_INVALID] = "a value is out of its range",
        [RESULT_FORMAT] = "the data are malformed",
        [RESULT_LIMIT] = "the data are larger than the limit",
        [RESULT_MISSING] = "something required is missing",
        [RESULT_VERSION] = "the version is not supported",
        [RESULT_CORRUPT] = "a checksum does not match",
        [RESULT_REFUSED] = "the request was refused",
        [RESULT_TIMEOUT] = "no answer came in time",
        [RESULT_CLOSED] = "the other side has gone",
        [RESULT_IO] = "the operating system reported an error",
    };
    if ((unsigned)result >= RESULT_COUNT)
        return "an unknown result";
    return sentences[result];
}

enum result fail(struct error *err, enum result code, const char *format, ...) {
    if (err) {
        va_list args;
        va_start(args, format);
        vsnprintf(err->text, sizeof err->text, format, args);
        va_end(args);
    }
    return code;
}

enum result fail_in(struct error *err, enum result code, const char *format, ...) {
    if (err) {
        char inner[sizeof err->text];
        memcpy(inner, err->text, sizeof inner);
        va_list args;
        va_start(args, format);
        int used = vsnprintf(err->text, sizeof err->text, format, args);
        va_end(args);
        if (used >= 0 && (size_t)used < sizeof err->text)
            snprintf(err->text + used, sizeof err->text - (size_t)used, "%s", inner);
    }
    return code;
}

const char *error_without_folder(const char *text) {
    const char *name = text + strcspn(text, ",:");
    if (*text != '/')
        return text;
    while (name[-1] != '/')
        name--;
    return name;
}
