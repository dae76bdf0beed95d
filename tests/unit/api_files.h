// A server's folder for the tests of api: records with people, keys, two cases, traces; and
// requests to it without a socket.
#pragma once

#include "api/api.h"
#include "store/store.h"

#include <jansson.h>

#define SESSION_ADA "00000000000000000000000000000001"    // closed, on healthy, of ada
#define SESSION_EVE "00000000000000000000000000000002"    // closed, on healthy, of eve
#define SESSION_NOBODY "00000000000000000000000000000003" // closed, on torn, of nobody

// Encoded at no cost; it fits no password.
#define NO_PASSWORD "$argon2id$v=19$m=8,t=1,p=1$c29tZXNhbHQ$aGFzaA"

#define PASSWORD "correct horse battery"

// What argon2 makes of PASSWORD at next to no cost.
#define ENCODED                                                                                    \
    "$argon2id$v=19$m=8,t=1,p=1$MDEyMzQ1Njc4OWFiY2RlZg$gLHIkr1qgP"                                 \
    "4r3sH1P/NIg3+PMckaLQ3RkuIiytJhVlY"

extern struct api *the_api;
extern char api_dir[];

// Accounts grace (instructor), tom (technician), ada.l (trainee ada) without usable passwords;
// trainees ada (course autumn) and eve; stations room-1 (ada) and room-2; cases healthy, and torn
// whose folder is empty; tasks steady, and probing with a probe.
int api_begin(void **state);
// The same without accounts.
int api_begin_new(void **state);
int api_end(void **state);

// Another server on the same folder.
void api_restart(void);
// What such a server asks before it reads a case, or NULL; what it does before it writes a report.
extern case_checker api_checker;
extern void (*api_on_report)(void);
// An expert's hands are computed for steady on healthy alone, the bytes "hands": how often that
// was tried; what happens meanwhile, or NULL.
extern int api_rehearsed;
extern bool api_rehearse_fails; // in a way that may pass
extern void (*api_on_rehearse)(void);

// The other servers; NULL: there are none.
extern const struct api_cluster *api_cluster;

extern bool api_passed_on; // what is asked, by another server

// The attempts of exams that were released.
extern int api_released;

void api_wait_for_cases(const char *token); // until all are read

const char *in_api(const char *name);           // a path in the folder; good for four calls
struct store *api_store(void);                  // for the caller to close
const char *token_of(const char *account);      // a new one, of an account; good for four calls
const char *token_of_code(const char *trainee); // of a browser that came in by a code

// What came back. Its members live until the next request.
extern struct web_response answer;
extern const char *device; // the device cookie that requests have, or NULL
extern json_t *said;       // the body where it is JSON, else NULL

// "GET", "/sessions?limit=3": the status. token, body: or NULL.
int ask(const char *method, const char *path, const char *token, const char *body);
int ask_from(const char *address, const char *method, const char *path, const char *token,
             const char *body);

void give_password(const char *account); // PASSWORD
int sign_in(const char *name, const char *password);

const char *error_code(void); // of `said`, empty: there is none
const char *error_field(void);
const char *text_at(const char *path); // "account.name", "sessions.0.id": a text, or "(none)"
size_t count_at(const char *key);      // of an array of `said`
double number_at(const char *path);    // NaN: none
