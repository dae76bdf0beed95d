// A file encrypted under a passphrase, which also shows every change of it.
//
// The key is made with argon2id (64 MiB, 3 passes). Pieces of 64 KiB are encrypted with
// AES-256-GCM as they are read, so a file of any size takes little memory. Each piece has its
// number, and the last one is marked (the STREAM construction), so none can be moved, left out or
// cut off.
//
// Layout, little-endian: "arthron sealed" and two bytes 0, 1; memory in KiB, passes and lanes of
// argon2 (3 x u32); salt (16 bytes); nonce (7 bytes) and a byte 0; the first 16 bytes of the
// HMAC-SHA-256 of all that; then the pieces, each with its tag of 16 bytes. argon2 gives 32 bytes
// for AES and 32 for the HMAC. A piece's nonce is the 7 bytes, its number (u32, big-endian), and 1
// for the last one. The tags authenticate all that is before the pieces, too.
#pragma once

#include "base/result.h"

#include <stdbool.h>

// Whether a file begins as such a file does.
bool sealed_file_is(const char *path);

// Both write a new file of this user alone, whole or not at all. RESULT_REFUSED: it is there.
enum result sealed_file_write(const char *path, const char *passphrase, const char *out_path,
                              struct error *err);
// RESULT_REFUSED: the passphrase is wrong. RESULT_CORRUPT: the file was changed, or is cut off.
enum result sealed_file_read(const char *path, const char *passphrase, const char *out_path,
                             struct error *err);
