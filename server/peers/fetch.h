// Fetches a case from another server by the hash of its content (case/content.h). The same words
// for both sides.
#pragma once

#include "peers/ask.h"

#define FETCH_PATH                                                                                 \
    "/api/v1/peer/cases" // ?hash=HASH: {files: [{name, size, sha256}]}; /NAME?hash=HASH: a file
#define FETCH_CHECK "check.json" // comes along where it is there
#define FETCH_CHECK_MAX ((uint64_t)4 << 20)

struct fetch_source {
    const char *pages, *secret; // of the server that is asked
};

// Puts the case with this hash into the folder `dir`. What was there is kept beside it under
// another name, in out_kept; empty: nothing was. Nothing changes before all has come and has the
// hash. RESULT_MISSING: that server does not have it. RESULT_CORRUPT: what came is not what was
// asked for. Otherwise as peer_ask.
enum result fetch_case(struct peers *peers, const struct fetch_source *source, const char *hash,
                       const char *dir, char *out_kept, size_t size, struct error *err);
