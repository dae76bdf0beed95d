// A password that a person types or a file has, as the records keep it; and the passphrase of a
// backup.
#pragma once

#include "store/store.h"

// From the first line of a file ("-": of stdin), or, where path is NULL, asked for twice on the
// terminal without showing it. What argon2 has encoded already ("$argon2...") is taken as it is.
// RESULT_REFUSED: path is NULL and stdin is no terminal.
enum result records_read_password(const char *path, char out_encoded[STORE_TEXT_MAX],
                                  struct error *err);

// As it is in the first line of a file ("-": of stdin). RESULT_INVALID: it is too short. The caller
// overwrites it when it is no longer needed.
#define PASSPHRASE_MAX 1088
enum result passphrase_read(const char *path, char out_passphrase[PASSPHRASE_MAX],
                            struct error *err);
