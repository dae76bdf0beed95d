// What the checks of the server's cases say (check/standing.h), as long as the server runs. From
// any thread.
#pragma once

#include "sessions/config.h"

struct grades;

// The config outlives it; hashes[i] is that of the config's case i.
struct grades *grades_create(const struct sessions_config *config, const uint64_t hashes[]);
void grades_destroy(struct grades **grades); // NULL inside is fine

// Looks at the files (a stat for each case), and logs what has changed.
void grades_refresh(struct grades *grades);

const char *grades_name(struct grades *grades, int index);

// Why no session is on this case; RESULT_OK where one may be. Touches no file.
enum result grades_allow(struct grades *grades, int index, struct error *err);
