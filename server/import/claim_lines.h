// What the claims of all formats share: a file by lines, and the points that it names.
#pragma once

#include "import/claim.h"

#include <stdbool.h>
#include <stdio.h>

// `line` has neither blanks at its start nor its line's end.
struct line_reader {
    FILE *file;
    char *buffer, *line;
    size_t room;
    unsigned number;     // of the line, from 1
    bool foul;           // reading has ended at a zero byte or a carriage return inside of a line
    uint32_t points_max; // that are kept
};

bool claim_next_line(struct line_reader *r);

// Takes the vertex into out->positions. Beyond r->points_max it is passed over: the reader refuses
// the file then.
void claim_keep(const struct line_reader *r, struct import_claim *out, const double point[3]);

// Three numbers from the start of the text; what follows them, or NULL.
const char *claim_three_numbers(const char *text, double out[3]);

enum result claim_of_ply(struct line_reader *r, const char *path, struct import_claim *out,
                         struct error *err);
