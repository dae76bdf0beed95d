#include "watch/log_json.h"

#include "base/check.h"
#include "base/log.h"
#include "watch/log_station.h"

#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static json_t *text_of(const char *text, size_t size) {
    json_t *whole = json_stringn(text, size);
    if (whole)
        return whole;
    char *plain = alloc(size + 1, 1);
    for (size_t i = 0; i < size; i++)
        plain[i] = text[i] & '\x80' ? '?' : text[i];
    whole = json_stringn(plain, size);
    free(plain);
    return whole;
}

static void print_as_json(const struct log_line *line) {
    size_t size;
    const char *station = log_station(line->text, &size);
    json_t *object =
        json_pack("{ss ss ss}", "time", line->when, "level", line->level, "room", line->room);
    if (station)
        json_object_set_new(object, "station", text_of(station, size));
    json_object_set_new(object, "message", text_of(line->text, strlen(line->text)));
    char *text = json_dumps(object, JSON_COMPACT); // one write: others have this stderr, too
    fprintf(stderr, "%s\n", text ? text : "{}");
    free(text);
    json_decref(object);
}

void log_as_json(void) {
    log_print_by(print_as_json);
}
