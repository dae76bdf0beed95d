// The tables of an archive and their columns: what is written, and what the codebook says of it.
#pragma once

#include "store/store.h"

#include <stdio.h>

enum study_cell { CELL_AS_IT_IS, CELL_TIME, CELL_SWITCH, CELL_TRAINEE, CELL_RATER };

struct study_column {
    const char *name, *source; // source: its column in the records; NULL: it has the same name
    enum study_cell as;
    const char *type, *unit, *meaning, *missing; // for the codebook
};

struct study_table {
    const char *file, *rows;            // "attempts.csv", "attempts"
    const struct study_column *columns; // ended by a NULL name
};

enum study_table_id {
    TABLE_ATTEMPTS,
    TABLE_FIGURES,
    TABLE_ERRORS,
    TABLE_RATINGS,
    TABLE_RESULTS,
    TABLE_COUNT
};
extern const struct study_table study_tables[TABLE_COUNT];

void study_put_heading(FILE *file, const struct study_table *table);
void study_put_codebook(FILE *file);

// A cell, and what stands behind it: a comma, or the row's end.
void study_put_text(FILE *file, const char *text, bool last);
void study_put_number(FILE *file, double value, bool last);

// The cell of this name; one of kind STORE_NULL where there is none.
const struct store_cell *study_cell_of(const struct store_cell *cells, int count,
                                       const char *column);
