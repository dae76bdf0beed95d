#include "base/log.h"

#include "base/bucket.h"
#include "base/clock.h"

#include <inttypes.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
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

// ---- one line -----------------------------------------------------------------------------------

static void print_text(const struct log_line *line) {
    fprintf(stderr, "%s %s %s: %s\n", line->when, line->level, line->room, line->text);
}

static void (*print_line)(const struct log_line *line) = print_text;

void log_print_by(void (*print)(const struct log_line *line)) {
    print_line = print;
}

// ---- too many lines -----------------------------------------------------------------------------

#define KINDS_MAX 256
#define LINES_PER_S 5
#define LINES_BURST 200
#define TOLD_NS (10 * NS_PER_S)

static bool limited;
static struct kind { // of line
    const char *room, *format;
    struct bucket lines;
    uint64_t left_out;
    int64_t left_out_ns; // the first of them
} kinds[KINDS_MAX];
static int kind_count;

static struct kind *find_kind(const char *room, const char *format) {
    for (int i = 0; i < kind_count; i++)
        if (kinds[i].format == format && !strcmp(kinds[i].room, room))
            return &kinds[i];
    if (kind_count == KINDS_MAX)
        return NULL;
    kinds[kind_count] = (struct kind){.room = room, .format = format};
    return &kinds[kind_count++];
}

static bool is_left_out(const char *room, const char *format, int64_t now_ns) {
    struct kind *kind = find_kind(room, format);
    if (!kind || bucket_take(&kind->lines, LINES_PER_S, LINES_BURST, now_ns))
        return false;
    if (!kind->left_out++)
        kind->left_out_ns = now_ns;
    return true;
}

static void tell_left_out(const char *when, int64_t now_ns) {
    for (int i = 0; i < kind_count; i++) {
        struct kind *kind = &kinds[i];
        if (!kind->left_out || now_ns - kind->left_out_ns < TOLD_NS)
            continue;
        char text[256];
        snprintf(text, sizeof text, "%" PRIu64 " lines were left out like \"%s\"", kind->left_out,
                 kind->format);
        print_line(&(struct log_line){when, "warning", kind->room, text});
        kind->left_out = 0;
    }
}

void log_limit_lines(void) {
    limited = true;
}

// ---- lines --------------------------------------------------------------------------------------

// Under the lock.
static void print(const char *when, const char *level, const char *room, const char *text) {
    bool shown_again = open_question[0] && isatty(STDERR_FILENO);
    if (question_is_last)
        fputc('\n', stderr);
    print_line(&(struct log_line){when, level, room, text});
    if (shown_again)
        fputs(open_question, stderr);
    question_is_last = shown_again;
}

static void write_time(char out[40]) {
    struct timespec now;
    struct tm utc;
    clock_gettime(CLOCK_REALTIME, &now);
    gmtime_r(&now.tv_sec, &utc);
    size_t used = strftime(out, 40, "%Y-%m-%dT%H:%M:%S", &utc);
    snprintf(out + used, 40 - used, ".%03ldZ", now.tv_nsec / 1000000);
}

void log_write(enum log_level level, const char *room, const char *format, ...) {
    static const char *const names[] = {"error", "warning", "info", "debug"};
    if (level > shown)
        return;
    char when[40], text[1024];
    int64_t now_ns = clock_now_ns();
    write_time(when);
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    pthread_mutex_lock(&lock);
    if (limited)
        tell_left_out(when, now_ns);
    if (!limited || !is_left_out(room, format, now_ns))
        print(when, names[level], room, text);
    pthread_mutex_unlock(&lock);
}
