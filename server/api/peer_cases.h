// The contents of the cases (case/content.h), for other servers that ask for one by its hash.
#pragma once

#include "api/api.h"

struct peer_cases;

struct peer_cases *peer_cases_create(const struct api_case *cases, int count);
void peer_cases_destroy(struct peer_cases **peer_cases); // NULL inside is fine
