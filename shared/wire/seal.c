#include "wire/seal.h"

#include "base/check.h"

#include <openssl/evp.h>
#include <stdlib.h>
#include <string.h>

#define VERSION 1
#define SEQUENCE_END (1ull << 32) // one key seals fewer datagrams than this
#define WINDOW_WORDS (SEAL_WINDOW / 64)

struct seal {
    enum seal_direction direction;
    uint8_t epoch;
    uint32_t connection;
    uint8_t iv[SEAL_IV_SIZE];
    EVP_CIPHER_CTX *sealing, *opening; // keyed once: a datagram sets only its nonce
    uint64_t next;                     // sequence to seal under
    uint64_t newest;                   // highest sequence opened, 0 from the start
    uint64_t seen[WINDOW_WORDS];       // one bit for each of the last SEAL_WINDOW sequences
};

static EVP_CIPHER_CTX *keyed_context(const uint8_t key[SEAL_KEY_SIZE], int sealing) {
    EVP_CIPHER_CTX *context = EVP_CIPHER_CTX_new();
    NEED(context, "memory");
    int done = EVP_CipherInit_ex(context, EVP_aes_128_gcm(), NULL, key, NULL, sealing);
    NEED(done == 1, "memory");
    return context;
}

struct seal *seal_create(enum seal_direction direction, uint8_t epoch, uint32_t connection,
                         const uint8_t key[SEAL_KEY_SIZE], const uint8_t iv[SEAL_IV_SIZE]) {
    CHECK(direction == SEAL_TO_SERVER || direction == SEAL_TO_STATION);
    struct seal *seal = alloc(1, sizeof *seal);
    seal->direction = direction;
    seal->epoch = epoch;
    seal->connection = connection;
    memcpy(seal->iv, iv, SEAL_IV_SIZE);
    seal->sealing = keyed_context(key, 1);
    seal->opening = keyed_context(key, 0);
    return seal;
}

void seal_destroy(struct seal **seal) {
    if (!*seal)
        return;
    EVP_CIPHER_CTX_free((*seal)->sealing); // wipes the key
    EVP_CIPHER_CTX_free((*seal)->opening);
    free(*seal);
    *seal = NULL;
}

// ---- header and nonce ---------------------------------------------------------------------------

static void put_big_endian(uint8_t *data, uint64_t value, int size) {
    for (int i = 0; i < size; i++)
        data[i] = (uint8_t)(value >> 8 * (size - 1 - i));
}

static uint64_t get_big_endian(const uint8_t *data, int size) {
    uint64_t value = 0;
    for (int i = 0; i < size; i++)
        value = value << 8 | data[i];
    return value;
}

static void write_header(const struct seal *seal, uint64_t sequence, uint8_t *data) {
    data[0] = VERSION;
    data[1] = (uint8_t)seal->direction;
    data[2] = seal->epoch;
    data[3] = 0;
    put_big_endian(data + 4, seal->connection, 4);
    put_big_endian(data + 8, sequence, 8);
}

bool seal_peek(const uint8_t *datagram, size_t size, struct seal_header *out_header) {
    if (size < SEAL_OVERHEAD || datagram[0] != VERSION || datagram[3] != 0)
        return false;
    if (datagram[1] != SEAL_TO_SERVER && datagram[1] != SEAL_TO_STATION)
        return false;
    *out_header = (struct seal_header){
        .direction = (enum seal_direction)datagram[1],
        .epoch = datagram[2],
        .connection = (uint32_t)get_big_endian(datagram + 4, 4),
        .sequence = get_big_endian(datagram + 8, 8),
    };
    return true;
}

// The nonce is IV xor sequence (big-endian, at the end), as in TLS 1.3.
static void make_nonce(const struct seal *seal, uint64_t sequence, uint8_t nonce[SEAL_IV_SIZE]) {
    memcpy(nonce, seal->iv, SEAL_IV_SIZE);
    for (int i = 0; i < 8; i++)
        nonce[SEAL_IV_SIZE - 1 - i] ^= (uint8_t)(sequence >> 8 * i);
}

// ---- sealing ------------------------------------------------------------------------------------

bool seal_exhausted(const struct seal *seal) {
    return seal->next >= SEQUENCE_END;
}

size_t seal_seal(struct seal *seal, const uint8_t *message, size_t size, uint8_t *out_datagram) {
    CHECK(!seal_exhausted(seal)); // a nonce used twice gives the key's secrets away
    uint64_t sequence = seal->next++;
    uint8_t nonce[SEAL_IV_SIZE];
    make_nonce(seal, sequence, nonce);
    write_header(seal, sequence, out_datagram);
    uint8_t *text = out_datagram + SEAL_HEADER_SIZE, *tag = text + size;
    EVP_CIPHER_CTX *c = seal->sealing;
    int used;
    bool done = EVP_EncryptInit_ex(c, NULL, NULL, NULL, nonce) == 1 &&
                EVP_EncryptUpdate(c, NULL, &used, out_datagram, SEAL_HEADER_SIZE) == 1 &&
                (!size || EVP_EncryptUpdate(c, text, &used, message, (int)size) == 1) &&
                EVP_EncryptFinal_ex(c, tag, &used) == 1 &&
                EVP_CIPHER_CTX_ctrl(c, EVP_CTRL_AEAD_GET_TAG, SEAL_TAG_SIZE, tag) == 1;
    NEED(done, "memory");
    return size + SEAL_OVERHEAD;
}

// ---- opening ------------------------------------------------------------------------------------

static size_t window_word(uint64_t sequence) {
    return sequence / 64 % WINDOW_WORDS;
}

static uint64_t window_bit(uint64_t sequence) {
    return 1ull << sequence % 64;
}

bool seal_has_seen(const struct seal *seal, uint64_t sequence) {
    if (sequence > seal->newest)
        return false;
    return seal->newest - sequence >= SEAL_WINDOW ||
           (seal->seen[window_word(sequence)] & window_bit(sequence));
}

// Forgets what falls out of the window on the way from the newest to `sequence`.
static void window_move(struct seal *seal, uint64_t sequence) {
    if (sequence - seal->newest >= SEAL_WINDOW)
        memset(seal->seen, 0, sizeof seal->seen);
    else
        for (uint64_t s = seal->newest + 1; s <= sequence; s++)
            seal->seen[window_word(s)] &= ~window_bit(s);
    seal->newest = sequence;
}

static bool decrypt(struct seal *seal, const uint8_t *datagram, size_t text_size, uint64_t sequence,
                    uint8_t *out_message) {
    uint8_t nonce[SEAL_IV_SIZE], tag[SEAL_TAG_SIZE];
    make_nonce(seal, sequence, nonce);
    const uint8_t *text = datagram + SEAL_HEADER_SIZE;
    memcpy(tag, text + text_size, SEAL_TAG_SIZE);
    EVP_CIPHER_CTX *c = seal->opening;
    int used;
    return EVP_DecryptInit_ex(c, NULL, NULL, NULL, nonce) == 1 &&
           EVP_DecryptUpdate(c, NULL, &used, datagram, SEAL_HEADER_SIZE) == 1 &&
           (!text_size || EVP_DecryptUpdate(c, out_message, &used, text, (int)text_size) == 1) &&
           EVP_CIPHER_CTX_ctrl(c, EVP_CTRL_AEAD_SET_TAG, SEAL_TAG_SIZE, tag) == 1 &&
           EVP_DecryptFinal_ex(c, tag, &used) == 1;
}

static bool header_is_ours(const struct seal *seal, const struct seal_header *header) {
    return header->direction == seal->direction && header->epoch == seal->epoch &&
           header->connection == seal->connection && header->sequence < SEQUENCE_END;
}

bool seal_open(struct seal *seal, const uint8_t *datagram, size_t size, uint8_t *out_message,
               size_t *out_size, uint64_t *out_sequence) {
    struct seal_header header;
    if (!seal_peek(datagram, size, &header) || !header_is_ours(seal, &header) ||
        seal_has_seen(seal, header.sequence))
        return false;
    size_t text_size = size - SEAL_OVERHEAD;
    if (!decrypt(seal, datagram, text_size, header.sequence, out_message))
        return false;
    if (header.sequence > seal->newest)
        window_move(seal, header.sequence);
    seal->seen[window_word(header.sequence)] |= window_bit(header.sequence);
    *out_size = text_size;
    *out_sequence = header.sequence;
    return true;
}
