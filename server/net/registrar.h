// Whatever of the control room waits for the authority's files: a thread that enrols stations,
// keeps the record of revocations in memory and sees when the server's certificate was renewed, so
// that the control thread only ever asks. None of these functions waits for a file, except create
// and destroy; all but those two may come from any one thread.
#pragma once

#include "net/identity.h"
#include "websocket/tls_files.h"
#include "wire/wire.h"

#include <stdbool.h>

#define REGISTRAR_APPLICANTS_MAX 10

struct registrar;
struct peer; // only its address counts here

// Reads the record of revocations, then starts the thread. tls_files: of the server's certificate;
// it is the registrar's from then on. on_news(user) comes from the thread when an answer or another
// certificate is there; it may not block.
struct registrar *registrar_create(const char *authority_dir, struct tls_files *tls_files,
                                   void (*on_news)(void *user), void *user);

// Joins the thread. Who was not answered is forgotten, with the code unused. *registrar becomes
// NULL.
void registrar_destroy(struct registrar **registrar);

// One application a peer at a time: with a code, or, where that is empty, by the certificate that
// it has shown. False where REGISTRAR_APPLICANTS_MAX wait already.
bool registrar_apply(struct registrar *registrar, struct peer *applicant,
                     const struct identity *identity, const arthron_Enrol *enrol);

// The applicant has no use for an answer any more and gets none. Its code stays unused, unless the
// answer was being made already.
void registrar_withdraw(struct registrar *registrar, const struct peer *applicant);

// Takes one answer out: Enrolled or Refusal. False where none is ready.
bool registrar_next_answer(struct registrar *registrar, struct peer **out_applicant,
                           arthron_Control *out_answer);

// Whether a certificate's serial number (hex) is revoked, by a record not older than half a second
// and the time to read it.
bool registrar_is_revoked(struct registrar *registrar, const char *serial_hex);

// A station has come with this certificate: those issued to it before will be revoked.
void registrar_used(struct registrar *registrar, const struct identity *identity);

// The server's certificate and key where they were renewed since the last call; the caller's. NULL:
// they were not.
struct tls_credentials *registrar_take_credentials(struct registrar *registrar);
