#include "base/log.h"

#include <stdarg.h>
#include <stdio.h>
#include <time.h>

static enum log_level shown = LOG_INFO;

void log_set_level(enum log_level level) {
    shown = level;
}

void log_write(enum log_level level, const char *room, const char *format, ...) {
    static const char *const names[] = {"error", "warning", "info", "debug"};
    if (level > shown)
        return;
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    struct tm utc;
    gmtime_r(&now.tv_sec, &utc);
    char when[32], text[1024];
    strftime(when, sizeof when, "%Y-%m-%dT%H:%M:%S", &utc);
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    fprintf(stderr, "%s.%03ldZ %s %s: %s\n", when, now.tv_nsec / 1000000, names[level], room, text);
}
