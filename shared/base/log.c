#include "base/log.h"

#include <stdarg.h>
#include <stdio.h>
#include <time.h>
#include <unistd.h>

static enum log_level shown = LOG_INFO;

void log_set_level(enum log_level level) {
    shown = level;
}

static char open_question[256]; // under stderr's lock, as the next
static bool question_is_last;   // what stands on stderr's last line

void log_ask(const char *question) {
    flockfile(stderr);
    snprintf(open_question, sizeof open_question, "%s", question);
    fprintf(stderr, "%s", open_question);
    fflush(stderr);
    question_is_last = true;
    funlockfile(stderr);
}

void log_answered(void) {
    flockfile(stderr);
    open_question[0] = '\0';
    question_is_last = false;
    funlockfile(stderr);
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
    flockfile(stderr);
    bool shown_again = open_question[0] && isatty(STDERR_FILENO);
    fprintf(stderr, "%s%s.%03ldZ %s %s: %s\n%s", question_is_last ? "\n" : "", when,
            now.tv_nsec / 1000000, names[level], room, text, shown_again ? open_question : "");
    question_is_last = shown_again;
    funlockfile(stderr);
}
