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

#define AUTHORITY_HOSTS_MAX 16
#define AUTHORITY_HOST_SIZE 256

// What the server's certificate says.
struct authority_server {
    int64_t until_utc_s;
    int host_count;
    char hosts[AUTHORITY_HOSTS_MAX][AUTHORITY_HOST_SIZE]; // names and addresses
};

// RESULT_MISSING where there is none that can be read.
enum result authority_server(const char *dir, struct authority_server *out_server,
                             struct error *err);

// A new certificate for the server, of the same authority and for the same key, good for 2 years:
// for these host names and addresses, or, where host_count is 0, for those of the present one. A
// server that runs takes it within a second.
enum result authority_renew_server(const char *dir, const char *const *hosts, int host_count,
                                   struct authority_server *out_server, struct error *err);

// A one-time code for a station of this name, good for 15 minutes. It holds a secret and the
// authority's fingerprint (wire/code.h), so that the station can trust the server before it has any
// certificate. On disk is only a hash of the secret. An earlier code for that name is void.
enum result authority_issue_code(const char *dir, const char *station,
                                 char out_code[AUTHORITY_CODE_MAX], struct error *err);

#define AUTHORITY_CERTIFICATE_MAX 2048

// PKCS #10, DER, with an EC key on P-256. Its subject may be empty; a common name in it must be the
// station's.
struct authority_request {
    const uint8_t *der;
    size_t size;
};

// Certificates, DER: the station's, whose common name is its name, and the authority's.
struct authority_answer {
    size_t certificate_size, authority_size;
    uint8_t certificate_der[AUTHORITY_CERTIFICATE_MAX], authority_der[AUTHORITY_CERTIFICATE_MAX];
};

// Turns a code and a request into a certificate for the station that the code was made for. Uses
// the code up: of two who come with it at once, one gets a certificate. RESULT_REFUSED: no such
// code, it is too old, or made for another station than the request names. RESULT_FORMAT: mistyped,
// or no such request. RESULT_TIMEOUT: another process is at work on the folder; nothing has
// changed, try again. With any other result the fault lies in the folder, and the text names it:
// not for strangers.
enum result authority_enrol(const char *dir, const char *code,
                            const struct authority_request *request,
                            struct authority_answer *out_answer, struct error *err);

// The same for a station that has proved that it holds the certificate of this serial number, which
// stays good until the new one is used. RESULT_REFUSED: that one is revoked, or the station has too
// many.
enum result authority_renew(const char *dir, const char *station, const char *serial_hex,
                            const struct authority_request *request,
                            struct authority_answer *out_answer, struct error *err);

// The station has come with its certificate of this serial number: those issued to it before are
// revoked. RESULT_TIMEOUT as authority_enrol.
enum result authority_used(const char *dir, const char *station, const char *serial_hex,
                           int *out_revoked, struct error *err);

// From now on no certificate or code issued so far to this station is accepted. RESULT_MISSING: no
// certificate was ever issued to that name.
enum result authority_revoke(const char *dir, const char *station, struct error *err);

// Until when a station of this name has a certificate that is accepted; 0: it has none.
enum result authority_station_until(const char *dir, const char *station, int64_t *out_utc_s,
                                    struct error *err);
