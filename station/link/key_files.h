// A station's key and certificates, as files of its keys' folder:
//
//     station.key    the private key, and behind it its certificate: both change in one moment
//     station.pem    the certificate, for people
//     authority.pem  the certificate of the server's authority
//
// In a folder that an older program made, station.key holds the key alone.
#pragma once

#include "base/result.h"

#include <openssl/x509.h>
#include <stdbool.h>
#include <stdint.h>

#define KEY_FILES_PATH_SIZE 4096

struct key_files {
    char key[KEY_FILES_PATH_SIZE];
    char certificate[KEY_FILES_PATH_SIZE]; // where the key's certificate is: the same file, or not
    char authority[KEY_FILES_PATH_SIZE];
};

// RESULT_MISSING names a file that cannot be read.
enum result key_files_find(const char *dir, struct key_files *out_files, struct error *err);

// Whether this user may write into the folder, or make it where it is not there. Changes nothing.
enum result key_files_can_write(const char *dir, struct error *err);

// Makes the folder where it is not there. A reader sees the old key and certificate or the new
// ones. authority: NULL: it stays the same.
enum result key_files_write(const char *dir, EVP_PKEY *key, X509 *certificate, X509 *authority,
                            struct error *err);

// Two are equal where nobody has changed a file meanwhile.
struct key_stamps {
    struct {
        int64_t device, file, size, changed_s, changed_ns;
    } of[3];
};

void key_files_stamp(const char *dir, struct key_stamps *out_stamps);
