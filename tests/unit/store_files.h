// A folder of records for the tests of store, and what they put in and get out.
#pragma once

#include "folder.h"
#include "store/attempts.h"

#include <stdbool.h>
#include <stddef.h>

// A new folder, and "records.db" in it; end removes all of it.
extern char store_dir[FOLDER_MAX], store_path[FOLDER_MAX + 16];
int store_folder_begin(void **state);
int store_folder_end(void **state);

// "name" in the folder; texts live until it was called four more times.
const char *in_folder(const char *name);

void put_file(const char *name, const void *data, size_t size);
void *get_file(const char *name, size_t *out_size); // the caller frees; fails where it is not there
bool file_has(const char *name, const char *text);  // false where it is not there

// Runs SQL on a file of the folder without our program; "name" is made where it is not there.
bool sql_passes(const char *name, const char *sql);

// The rows of a list as text: "column=value|...\n" for each.
const char *rows_of(struct store *store, enum store_list list, const char *key);
int row_count(struct store *store, enum store_list list);

struct store *open_records(void); // made where they are not there
struct store_session a_session(unsigned number);

// One that passed: at task "centring", practice, right hand, of 40 s, a minute after the one
// before.
struct attempt_row an_attempt(const char *session, int number);
