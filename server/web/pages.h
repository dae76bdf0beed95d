// The pages that are built into the program: web/build.mjs writes the table as pages.c.
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct web_page {
    const char *path; // "/index.html" (what "/" gives, too), "/main-3f2a91c0.js"
    const char *type; // "text/javascript; charset=utf-8"
    const char *etag; // of its content, without quotes
    bool hashed;      // its path holds a hash of its content: browsers may keep it for ever
    const uint8_t *gzip;
    size_t gzip_size;
    size_t size; // unpacked
};

struct web_pages {
    const struct web_page *pages;
    int count;
};

extern const struct web_pages web_pages_built_in;
