// Sealing of pose datagrams: AES-128-GCM (OpenSSL) with an authenticated header, one key and IV for
// each direction and epoch, a nonce of IV xor sequence, and a replay window.
//
// Datagram: u8 version (1), u8 direction, u8 epoch, u8 zero, u32 connection, u64 sequence
// (big-endian) = 16 bytes of header, then the ciphertext, then 16 bytes of tag.
#pragma once

#include "base/result.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define SEAL_KEY_SIZE 16
#define SEAL_IV_SIZE 12
#define SEAL_HEADER_SIZE 16
#define SEAL_TAG_SIZE 16
#define SEAL_OVERHEAD (SEAL_HEADER_SIZE + SEAL_TAG_SIZE)
#define SEAL_WINDOW 1024

enum seal_direction { SEAL_TO_SERVER = 1, SEAL_TO_STATION = 2 };

struct seal_header {
    enum seal_direction direction;
    uint8_t epoch;
    uint32_t connection;
    uint64_t sequence;
};

// Reads the clear header only, so that the receiver can find the key. False where `datagram` is too
// short or of another version.
bool seal_peek(const uint8_t *datagram, size_t size, struct seal_header *out_header);

// One direction of one epoch, either end of it. Allocates once (OpenSSL's context); sealing and
// opening do not.
struct seal;

struct seal *seal_create(enum seal_direction direction, uint8_t epoch, uint32_t connection,
                         const uint8_t key[SEAL_KEY_SIZE], const uint8_t iv[SEAL_IV_SIZE]);
void seal_destroy(struct seal **seal);

// Seals under the next sequence number, from 0. `out_datagram` has room for size + SEAL_OVERHEAD
// bytes. Returns the length. Not once seal_exhausted: at 2^32 datagrams, a new epoch is due.
size_t seal_seal(struct seal *seal, const uint8_t *message, size_t size, uint8_t *out_datagram);
bool seal_exhausted(const struct seal *seal);

// Opens in full: header of this direction, epoch and connection, tag, then the replay window, which
// moves only after the tag verifies. False: drop it without an answer and count it; out_message,
// which has room for size - SEAL_OVERHEAD bytes, may then hold anything.
bool seal_open(struct seal *seal, const uint8_t *datagram, size_t size, uint8_t *out_message,
               size_t *out_size, uint64_t *out_sequence);

// Whether this sequence was opened before or lies SEAL_WINDOW or more behind the newest: a replay.
bool seal_has_seen(const struct seal *seal, uint64_t sequence);
