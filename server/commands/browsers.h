// Joins what browsers are served with: the pages and connections (web), the answers to /api/v1
// (api), and what happens in the sessions.
#pragma once

#include "config/config.h"
#include "sessions/sessions.h"

struct browsers;

// Serves from now on. The config must live as long. Errors are those of the records, and of the
// address, port and certificate.
enum result browsers_create(const struct server_config *config, struct sessions *sessions,
                            struct browsers **out_browsers, struct error *err);
void browsers_destroy(struct browsers **browsers); // before the sessions; NULL inside is fine
