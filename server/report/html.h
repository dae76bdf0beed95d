// Pages of HTML that stand alone: style and pictures are inside, scripts are none.
#pragma once

#include "report/picture.h"
#include "report/plot.h"

#include <stdio.h>

void html_begin(FILE *file, const char *title); // the heading, too
void html_end(FILE *file);
void html_text(FILE *file, const char *text); // UTF-8, escaped for elements and attributes

// A figure with its caption; alt stands in for the picture. Both are escaped.
enum result html_picture(FILE *file, const struct picture *picture, const char *alt,
                         const char *caption, struct error *err);

void html_plot(FILE *file, const struct plot *plot, const char *caption); // escaped
