// xAPI statements of attempts as they end: into a file, a statement a line, and from there to a
// learning record store where one is configured.
#pragma once

#include "store/store.h"
#include "xapi/settings.h"

struct xapi;

// While no other thread runs. *out is NULL where `file` is empty.
enum result xapi_start(const struct xapi_settings *settings, struct xapi **out, struct error *err);

// Writes the statement of an attempt that the records have, if it has one: of an exam's, once that
// is released. Waits for the disk, never for the network; what fails is logged. Any thread.
void xapi_attempt_told(struct xapi *xapi, struct store *store, const char *session, int number);

void xapi_stop(
    struct xapi **xapi); // what was not sent waits for the next start; NULL inside is fine
