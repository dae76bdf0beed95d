#include "report/html.h"

#include <stdlib.h>

static const char page_style[] =
    "body { font: 16px/1.5 sans-serif; max-width: 70em; margin: 2em auto; padding: 0 1em;"
    " color: #222; }\n"
    "h1, h2 { line-height: 1.2; font-weight: 600; }\n"
    "h2 { margin-top: 2em; }\n"
    ".row { display: flex; flex-wrap: wrap; gap: 1em; }\n"
    "figure { margin: 0; flex: 1 1 18em; max-width: 40em; }\n"
    "figure img { width: 100%; height: auto; border: 1px solid #ddd; }\n"
    "figure > svg { width: 100%; height: auto; }\n"
    "figcaption { font-size: 90%; color: #444; }\n"
    "table { border-collapse: collapse; margin: 1em 0; }\n"
    "th, td { padding: 0.3em 1em 0.3em 0; border-bottom: 1px solid #ddd; text-align: left;"
    " vertical-align: top; }\n"
    "td.n, th.n { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }\n"
    "th.n { white-space: normal; }\n"
    "@media (prefers-color-scheme: dark) {\n"
    " body { color: #ddd; background: #16181b; }\n"
    " figcaption { color: #bbb; }\n"
    " th, td, figure img { border-color: #444; }\n"
    " a { color: #7ab8ff; }\n"
    "}\n";

void html_begin(FILE *file, const char *title) {
    fputs("<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
          "<meta name=\"viewport\" content=\"width=device-width\">\n<title>",
          file);
    html_text(file, title);
    fprintf(file, "</title>\n<style>\n%s</style>\n</head>\n<body>\n<h1>", page_style);
    html_text(file, title);
    fputs("</h1>\n", file);
}

void html_end(FILE *file) {
    fputs("</body>\n</html>\n", file);
}

void html_text(FILE *file, const char *text) {
    for (; *text; text++) {
        switch (*text) {
        case '&':
            fputs("&amp;", file);
            break;
        case '<':
            fputs("&lt;", file);
            break;
        case '>':
            fputs("&gt;", file);
            break;
        case '"':
            fputs("&quot;", file);
            break;
        case '\'':
            fputs("&#39;", file);
            break;
        default:
            putc(*text, file);
        }
    }
}

// RFC 4648, section 4.
static void write_base64(FILE *file, const uint8_t *bytes, size_t size) {
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (size_t i = 0; i < size; i += 3) {
        size_t left = size - i;
        uint32_t bits = (uint32_t)bytes[i] << 16;
        bits |= left > 1 ? (uint32_t)bytes[i + 1] << 8 : 0;
        bits |= left > 2 ? bytes[i + 2] : 0;
        for (size_t k = 0; k < 4; k++)
            putc(k <= left ? digits[bits >> (18 - 6 * k) & 63] : '=', file);
    }
}

enum result html_picture(FILE *file, const struct picture *picture, const char *alt,
                         const char *caption, struct error *err) {
    uint8_t *bytes;
    size_t size;
    enum result result = picture_encode(picture, &bytes, &size, err);
    if (result != RESULT_OK)
        return result;
    fprintf(file, "<figure><img width=\"%d\" height=\"%d\" alt=\"", picture->width,
            picture->height);
    html_text(file, alt);
    fputs("\" src=\"data:image/png;base64,", file);
    write_base64(file, bytes, size);
    fputs("\"><figcaption>", file);
    html_text(file, caption);
    fputs("</figcaption></figure>\n", file);
    free(bytes);
    return RESULT_OK;
}

void html_plot(FILE *file, const struct plot *plot, const char *caption) {
    fputs("<figure>", file);
    plot_write(file, plot);
    fputs("<figcaption>", file);
    html_text(file, caption);
    fputs("</figcaption></figure>\n", file);
}
