// The server's own certificate authority: one place for trust. All files live in one folder
// (authority.key, authority.pem, server.key, server.pem, codes, issued, enrolled, revoked),
// readable by the server's user alone; authority.key may lie in a folder of its own. Any number of
// processes and threads may work on it at once.
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
// RESULT_REFUSED: the folder has an authority already.
enum result authority_init(const char *dir, const char *const *hosts, int host_count,
                           struct error *err);

#define AUTHORITY_HOSTS_MAX 16
#define AUTHORITY_HOST_SIZE 256

// The content of the server's certificate.
struct authority_server {
    int64_t until_utc_s;
    int host_count;
    char hosts[AUTHORITY_HOSTS_MAX][AUTHORITY_HOST_SIZE]; // names and addresses
};

// RESULT_MISSING: there is no readable certificate.
enum result authority_server(const char *dir, struct authority_server *out_server,
                             struct error *err);

// The end of a certificate in the folder (authority.pem, server.pem), in seconds since 1970; 0: it
// cannot be read.
int64_t authority_certificate_end(const char *dir, const char *name);

// Makes a new certificate for the server, from the same authority, for the same key and 2 years. It
// is for these host names and addresses, or for the present ones if host_count is 0. A running
// server takes it within a second.
enum result authority_renew_server(const char *dir, const char *const *hosts, int host_count,
                                   struct authority_server *out_server, struct error *err);

// Where the authority's private key is, and what opens it.
struct authority_key_place {
    const char *dir;        // of authority.key; NULL or empty: the authority's own folder
    const char *passphrase; // the file whose first line opens it; NULL or empty: the file
                            // authority-passphrase in $CREDENTIALS_DIRECTORY, if it is there
};

// For this process, before it uses an authority. The texts must live as long.
void authority_place_key(const struct authority_key_place *place);

// Whether the authority's key can be used. RESULT_MISSING: it is not there. RESULT_INVALID: it is
// encrypted, and its passphrase is missing or wrong. RESULT_CORRUPT: it is no private key.
enum result authority_check_key(const char *dir, bool *out_encrypted, struct error *err);

// Encrypts the authority's key from now on with the first line of this file; NULL: it lies in the
// clear. Errors as authority_check_key, and RESULT_INVALID if the line is too short.
enum result authority_change_passphrase(const char *dir, const char *passphrase, struct error *err);

// A one-time code for a station of this name, good for 15 minutes. It holds a secret and the
// authority's fingerprint (wire/code.h), so that the station can trust the server before it has any
// certificate. The disk holds only a hash of the secret. Earlier codes for the name become void.
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

// Makes a certificate for the code's station, from a code and a request. A code can be used once:
// if two applicants send it at the same time, one gets a certificate. RESULT_REFUSED: the code is
// unknown or too old, or the request names another station. RESULT_FORMAT: the code is mistyped, or
// the request is malformed. RESULT_TIMEOUT: another process uses the folder; nothing has changed,
// try again. Other results are faults of the folder. Their texts name files, so do not send them to
// the applicant.
enum result authority_enrol(const char *dir, const char *code,
                            const struct authority_request *request,
                            struct authority_answer *out_answer, struct error *err);

// The same for a station that has proved its certificate with this serial number. That certificate
// stays valid until the new one is used. RESULT_REFUSED: it is revoked, the station has been
// enrolled by code since, or it has too many certificates.
enum result authority_renew(const char *dir, const char *station, const char *serial_hex,
                            const struct authority_request *request,
                            struct authority_answer *out_answer, struct error *err);

// The station has connected with the certificate of this serial number: revokes those issued to it
// before. RESULT_TIMEOUT as authority_enrol.
enum result authority_used(const char *dir, const char *station, const char *serial_hex,
                           int *out_revoked, struct error *err);

// Revokes all certificates and voids all codes of this station. RESULT_MISSING: no certificate was
// ever issued to this name.
enum result authority_revoke(const char *dir, const char *station, struct error *err);

#define AUTHORITY_SERIALS_SIZE 16384

// The same where other servers have this authority, too, each with lists of its own. *serials: of
// certificates that others issued to this station, in hexadecimal digits, separated by blanks; on
// return of all of the station's that are revoked here and have not ended. RESULT_MISSING: nobody
// ever issued one. RESULT_FORMAT: they are none.
enum result authority_revoke_all(const char *dir, const char *station,
                                 char serials[AUTHORITY_SERIALS_SIZE], struct error *err);

// The end of the station's last valid certificate; 0: it has none.
enum result authority_station_until(const char *dir, const char *station, int64_t *out_utc_s,
                                    struct error *err);
