// Rows of the records for people and programs.
#pragma once

#include "store/store.h"

#include <jansson.h>
#include <stdio.h>

// A store_row_handler whose user is a json_t array: adds an object for each row.
void rows_take(void *array, const struct store_cell *cells, int count);

// A table with the columns' names above; times (columns that end in utc_ns) to the second, and
// without hashes, which no person reads.
void rows_print(const json_t *rows);

// DIR/LIST.csv for every list, for this user alone; makes the folder. RFC 4180, UTF-8, a first line
// of names.
enum result rows_export_csv(struct store *store, const char *dir, struct error *err);

// A file for this user alone, what was in it gone; RESULT_IO. rows_close says whether all is in it.
enum result rows_create(const char *path, FILE **out_file, struct error *err);
enum result rows_close(FILE *file, const char *path, struct error *err);
