#include "base/csv.h"

#include <stdbool.h>
#include <string.h>

void csv_put_text(FILE *file, const char *text) {
    bool quoted = strpbrk(text, ",\"\r\n");
    if (quoted)
        putc('"', file);
    if (*text && strchr("=+-@\t\r\n", *text))
        putc('\'', file);
    for (; *text; text++) {
        if (*text == '"')
            putc('"', file);
        putc(*text, file);
    }
    if (quoted)
        putc('"', file);
}
