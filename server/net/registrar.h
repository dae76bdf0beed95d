// The work of the control room that waits for the authority's files, on a thread of its own. It
// enrols stations, keeps the list of revocations in memory, and notices renewals of the server's
// certificate. So the control thread never waits for a file. Only create and destroy do; all other
// functions are for one thread, which may be any.
#pragma once

#include "net/identity.h"
#include "websocket/tls_files.h"
#include "wire/wire.h"

#include <stdbool.h>

#define REGISTRAR_APPLICANTS_MAX 10

struct registrar;
struct peer; // only its address is used

// Reads the list of revocations, then starts the thread. tls_files: of the server's certificate;
// the registrar owns it from now on. The thread calls on_news(user) when there is an answer or a
// new certificate; it must not block.
struct registrar *registrar_create(const char *authority_dir, struct tls_files *tls_files,
                                   void (*on_news)(void *user), void *user);

// Joins the thread. Applicants that wait get no answer, and their codes stay unused. *registrar
// becomes NULL.
void registrar_destroy(struct registrar **registrar);

// Each peer may apply once at a time: with a code, or, if that is empty, with its certificate.
// False: REGISTRAR_APPLICANTS_MAX applicants wait already.
bool registrar_apply(struct registrar *registrar, struct peer *applicant,
                     const struct identity *identity, const arthron_Enrol *enrol);

// The applicant gets no answer any more. Its code stays unused, unless the answer was being made
// already.
void registrar_withdraw(struct registrar *registrar, const struct peer *applicant);

// Takes one answer: Enrolled or Refusal. False: none is ready.
bool registrar_next_answer(struct registrar *registrar, struct peer **out_applicant,
                           arthron_Control *out_answer);

// Whether a certificate's serial number (hex) is revoked. The list is at most a quarter of a second
// old, plus the time to read it.
bool registrar_is_revoked(struct registrar *registrar, const char *serial_hex);

// Whether the list is another one than at the last call.
bool registrar_take_revoked(struct registrar *registrar);

// A station has connected with this certificate: those issued to it before will be revoked.
void registrar_used(struct registrar *registrar, const struct identity *identity);

// The server's certificate and key if they were renewed since the last call, else NULL. The caller
// releases them.
struct tls_credentials *registrar_take_credentials(struct registrar *registrar);
