// Scratch of fill.c.
#pragma once

struct filler;

struct filler *filler_create(void);
void filler_destroy(struct filler **filler);
