// One line on stderr for each message: "2026-11-21T08:30:00.123Z warning link: text".
// Safe from any thread; a line is never mixed with another.
#pragma once

#include <stdbool.h>

enum log_level { LOG_ERROR, LOG_WARNING, LOG_INFO, LOG_DEBUG };

// The lowest level that is printed; LOG_INFO at the start. Call it before other threads run.
void log_set_level(enum log_level level);

struct log_line {
    const char *when, *level, *room, *text;
};
// Another form of lines, each of which `print` writes on stderr, one at a time. Call it before
// other threads run.
void log_print_by(void (*print)(const struct log_line *line));

// For programs that run for long: of the lines of one kind (room and format) 200 are printed at
// once and then 5 a second. Those left out are counted, and told later. Call it before other
// threads run.
void log_limit_lines(void);

// room: the source of the message ("sessions", "modbus"). The text needs no newline.
void log_write(enum log_level level, const char *room, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

// Shows a question on stderr without an end of line. Until log_answered, a log line begins a line
// of its own, and on a terminal the question is shown again behind it.
void log_ask(const char *question);
void log_answered(void);

#define log_error(room, ...) log_write(LOG_ERROR, room, __VA_ARGS__)
#define log_warning(room, ...) log_write(LOG_WARNING, room, __VA_ARGS__)
#define log_info(room, ...) log_write(LOG_INFO, room, __VA_ARGS__)
#define log_debug(room, ...) log_write(LOG_DEBUG, room, __VA_ARGS__)
