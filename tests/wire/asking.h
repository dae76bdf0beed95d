// What tests ask the reception as a browser does.
#pragma once

#include "test.h"
#include "wire/browser.h"
#include "wire/reception.h"

#include <string.h>

static inline struct browser *call(void) {
    struct browser *browser = browser_open(reception.port);
    assert_non_null(browser);
    return browser;
}

static inline void say(struct browser *browser, const char *text) {
    assert_true(browser_say(browser, text, strlen(text)));
}

static inline void expect_header(const struct answered *a, const char *name, const char *value) {
    char text[512];
    assert_string_equal(answered_header(a, name, text), value);
}
