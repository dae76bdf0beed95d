#include "case/import_reader.h"

#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#define LINES_MAX 1000

static bool is_type(const char *word) {
    static const char *const types[] = {"char",  "uchar",   "short",  "ushort", "int",   "uint",
                                        "int8",  "uint8",   "int16",  "uint16", "int32", "uint32",
                                        "float", "float32", "double", "float64"};
    for (size_t i = 0; i < sizeof types / sizeof types[0]; i++)
        if (strcmp(word, types[i]) == 0)
            return true;
    return false;
}

// A list's length has at most 16 bits: OpenMesh makes room for whatever it reads there.
static bool is_length_type(const char *word) {
    return is_type(word) && !strstr(word, "int3") && strcmp(word, "int") != 0 &&
           strcmp(word, "uint") != 0 && !strstr(word, "float") && strcmp(word, "double") != 0;
}

static bool line_is_sound(const char *line) {
    char word[4][64] = {""}, name[64];
    int count = sscanf(line, "%63s %63s %63s %63s %63s", word[0], word[1], word[2], word[3], name);
    if (count <= 0 || strcmp(word[0], "comment") == 0 || strcmp(word[0], "obj_info") == 0)
        return true;
    if (strcmp(word[0], "format") == 0)
        return count == 3;
    if (strcmp(word[0], "element") == 0)
        return count == 3 && strlen(word[2]) < 10 &&
               strspn(word[2], "0123456789") == strlen(word[2]);
    if (strcmp(word[0], "property") != 0)
        return false;
    if (strcmp(word[1], "list") == 0)
        return count == 5 && is_length_type(word[2]) && is_type(word[3]);
    return count == 3 && is_type(word[1]);
}

enum result import_ply_check(const char *path, struct error *err) {
    FILE *file = fopen(path, "rb");
    if (!file)
        return fail(err, RESULT_IO, "%s: cannot be opened", path);
    char line[256] = "";
    int number = 0;
    bool ended = false, sound = true;
    while (sound && !ended && number < LINES_MAX && fgets(line, sizeof line, file)) {
        line[strcspn(line, "\r\n")] = '\0';
        number++;
        ended = strcmp(line, "end_header") == 0;
        sound = ended || (number == 1 ? strcmp(line, "ply") == 0 : line_is_sound(line));
    }
    fclose(file);
    if (sound && ended)
        return RESULT_OK;
    return fail(err, RESULT_FORMAT, "%s: the PLY header %s line %d", path,
                sound ? "does not end by" : "is not understood in", number);
}
