// What all xAPI statements of a site have in common.
#pragma once

#include "base/result.h"
#include "xapi/settings.h"

#include <jansson.h>

#define XAPI_IRI_MAX 1024
#define XAPI_VERSION "1.0.3"
#define XAPI_VERB "http://adlnet.gov/expapi/verbs/"
#define XAPI_ACTIVITY_TYPE "http://adlnet.gov/expapi/activities/"

// The site names accounts, cases and tasks: https://training.example.org/arthron, without a slash
// at the end. RESULT_INVALID says what is wrong with it.
enum result xapi_check_site(const char *site, struct error *err);
void xapi_usual_site(char out[XAPI_SITE_MAX]); // of this host's name

// A session's id (32 hexadecimal digits) as a UUID of version 4: by chance but for these bits.
void xapi_session_uuid(const char *id, char out[37]);
// Of the attempt with this number: version 5, of the session's UUID and "attempt NUMBER".
void xapi_attempt_uuid(const char *session, int number, char out[37]);

// SITE/KIND/NAME with the name's bytes encoded.
void xapi_iri(const char *site, const char *kind, const char *name, char out[XAPI_IRI_MAX]);
// An object with one entry, named SITE/xapi/NAME. Takes `value`.
json_t *xapi_extension(const char *site, const char *name, json_t *value);
json_t *xapi_actor(const char *site, const char *account);
json_t *xapi_verb(const char *name);              // of ADL: "completed"
void xapi_duration(double seconds, char out[32]); // "PT83.25S"; 0 at least
