// The server's own certificate authority: one place for trust. All files live in one folder
// (authority.key, authority.pem, server.key, server.pem, codes, issued, revoked), readable by the
// server's user alone. Any number of processes and threads may work on it at once.
//
// A station's name has letters, digits, '-', '_' and '.', from 1 to 63 of them: else
// RESULT_INVALID.
#pragma once

#include "base/result.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define AUTHORITY_CODE_MAX 96
#define AUTHORITY_CODE_S (15 * 60) // how long a code is good

bool authority_name_is_valid(const char *station);

// Makes the folder (its parent must be there), authority and server keys (EC P-256), and
// certificates: 10 years for the authority, 2 for the server of these host names and addresses.
// RESULT_REFUSED where an authority is there already.
enum result authority_init(const char *dir, const char *const *hosts, int host_count,
                           struct error *err);

// A one-time code for a station of this name, good for 15 minutes. It holds a secret and the
// authority's fingerprint (wire/code.h), so that the station can trust the server before it has any
// certificate. On disk is only a hash of the secret. An earlier code for that name is void.
enum result authority_issue_code(const char *dir, const char *station,
                                 char out_code[AUTHORITY_CODE_MAX], struct error *err);

// Turns code and request (PKCS #10, DER) into a certificate whose common name is the station's.
// Uses the code up: of two who come with it at once, one gets a certificate. RESULT_REFUSED: no
// such code, or it is too old. RESULT_FORMAT: mistyped, or not a request with an EC key on P-256.
// RESULT_TIMEOUT: another process is at work on the folder; nothing has changed, try again. With
// any other result the fault lies in the folder, and the text names it: not for strangers.
enum result authority_enrol(const char *dir, const char *code, const uint8_t *request_der,
                            size_t request_size, uint8_t *out_certificate_der,
                            size_t *in_out_certificate_size, uint8_t *out_authority_der,
                            size_t *in_out_authority_size, struct error *err);

// From now on no certificate or code issued so far to this station is accepted. RESULT_MISSING: no
// certificate was ever issued to that name.
enum result authority_revoke(const char *dir, const char *station, struct error *err);

// Until when a station of this name has a certificate that is accepted; 0: it has none.
enum result authority_station_until(const char *dir, const char *station, int64_t *out_utc_s,
                                    struct error *err);
