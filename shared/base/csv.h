// Text in a table that a spreadsheet may open (CSV, RFC 4180).
#pragma once

#include <stdio.h>

// One cell, in quotes where it needs them. A spreadsheet takes a cell that begins with =, +, -, @, a
// tab or a line's end for a formula: an apostrophe stands before it. Numbers are written otherwise.
void csv_put_text(FILE *file, const char *text);
