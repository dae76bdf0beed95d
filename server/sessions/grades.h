// The grades of the server's cases (check/standing.h), kept up to date while the server runs. Any
// thread may call these functions.
#pragma once

#include "sessions/config.h"

struct grades;

// The config must outlive it. Of the config's case i, hashes[i] is the hash, and refused[i] says
// why it cannot be read; empty: it was.
struct grades *grades_create(const struct sessions_config *config, const uint64_t hashes[],
                             const struct error refused[]);
void grades_destroy(struct grades **grades); // NULL inside is fine

// Looks at the files (a stat for each case), and logs each change.
void grades_refresh(struct grades *grades);

// Whether the case could not be read at the start, and why.
bool grades_are_broken(const struct grades *grades, int index, struct error *out_why);

const char *grades_name(struct grades *grades, int index);

// RESULT_OK if a session may be opened on this case; else the error says why not. Touches no file.
enum result grades_allow(struct grades *grades, int index, struct error *err);
