#define SD_JOURNAL_SUPPRESS_LOCATION // it would be that of this file

#include "watch/log_journal.h"

#include "base/log.h"
#include "watch/log_station.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <systemd/sd-journal.h>
#include <unistd.h>

// As systemd.exec(5) tells: stderr may be another file by now.
static bool stderr_is_journal(void) {
    const char *told = getenv("JOURNAL_STREAM");
    char here[64];
    struct stat file;
    if (!told || fstat(STDERR_FILENO, &file))
        return false;
    snprintf(here, sizeof here, "%" PRIuMAX ":%" PRIuMAX, (uintmax_t)file.st_dev,
             (uintmax_t)file.st_ino);
    return !strcmp(told, here);
}

static int priority_of(const char *level) {
    static const struct {
        const char *level;
        int priority;
    } priorities[] = {{"error", 3}, {"warning", 4}, {"debug", 7}};
    for (size_t i = 0; i < sizeof priorities / sizeof *priorities; i++)
        if (!strcmp(level, priorities[i].level))
            return priorities[i].priority;
    return 6;
}

static void print_to_journal(const struct log_line *line) {
    char message[1200], priority[16], room[64], station[256];
    struct iovec fields[4];
    int count = 0;
    size_t name_size;
    const char *name = log_station(line->text, &name_size);
    snprintf(message, sizeof message, "MESSAGE=%s: %s", line->room, line->text);
    snprintf(priority, sizeof priority, "PRIORITY=%d", priority_of(line->level));
    snprintf(room, sizeof room, "ARTHRON_ROOM=%s", line->room);
    fields[count++] = (struct iovec){message, strlen(message)};
    fields[count++] = (struct iovec){priority, strlen(priority)};
    fields[count++] = (struct iovec){room, strlen(room)};
    if (name) {
        snprintf(station, sizeof station, "ARTHRON_STATION=%.*s", (int)name_size, name);
        fields[count++] = (struct iovec){station, strlen(station)};
    }
    if (sd_journal_sendv(fields, count) < 0)
        fprintf(stderr, "%s %s: %s\n", line->level, line->room, line->text);
}

void log_to_journal(void) {
    if (stderr_is_journal())
        log_print_by(print_to_journal);
}
