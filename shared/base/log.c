#include "base/log.h"

#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <time.h>
#include <unistd.h>

static enum log_level shown = LOG_INFO;

void log_set_level(enum log_level level) {
    shown = level;
}

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER; // of what follows, and of stderr
static char open_question[256];
static bool question_is_last; // what stands on stderr's last line

void log_ask(const char *question) {
    pthread_mutex_lock(&lock);
    snprintf(open_question, sizeof open_question, "%s", question);
    fprintf(stderr, "%s", open_question);
    fflush(stderr);
    question_is_last = true;
    pthread_mutex_unlock(&lock);
}

void log_answered(void) {
    pthread_mutex_lock(&lock);
    open_question[0] = '\0';
    question_is_last = false;
    pthread_mutex_unlock(&lock);
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
    pthread_mutex_lock(&lock);
    bool shown_again = open_question[0] && isatty(STDERR_FILENO);
    fprintf(stderr, "%s%s.%03ldZ %s %s: %s\n%s", question_is_last ? "\n" : "", when,
            now.tv_nsec / 1000000, names[level], room, text, shown_again ? open_question : "");
    question_is_last = shown_again;
    pthread_mutex_unlock(&lock);
}
