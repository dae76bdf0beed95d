// Sealed datagrams: what opens, what never does. The oracle is seal_by_hand, which makes datagrams
// from the layout in PROTOCOL.md with OpenSSL's calls, and one vector made by another program.
#include "wire/seal.h"

#include "random.h"
#include "test.h"

#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <stdlib.h>
#include <string.h>

static const uint8_t key[SEAL_KEY_SIZE] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
static const uint8_t iv[SEAL_IV_SIZE] = {0xa0, 0xa1, 0xa2, 0xa3, 0xa4, 0xa5,
                                         0xa6, 0xa7, 0xa8, 0xa9, 0xaa, 0xab};

#define CONNECTION 0x01020304u
#define EPOCH 7
#define TEXT "pose"
#define TEXT_SIZE 4
#define SEALED_SIZE (TEXT_SIZE + SEAL_OVERHEAD)

static struct seal *to_server(void) {
    return seal_create(SEAL_TO_SERVER, EPOCH, CONNECTION, key, iv);
}

static void seal_by_hand(const struct seal_header *h, uint8_t out[SEALED_SIZE]) {
    uint8_t header[SEAL_HEADER_SIZE] = {1, (uint8_t)h->direction, h->epoch, 0}, nonce[12];
    for (int i = 0; i < 4; i++)
        header[4 + i] = (uint8_t)(h->connection >> (24 - 8 * i));
    for (int i = 0; i < 8; i++)
        header[8 + i] = (uint8_t)(h->sequence >> (56 - 8 * i));
    memcpy(nonce, iv, 12);
    for (int i = 0; i < 8; i++)
        nonce[4 + i] ^= header[8 + i];
    EVP_CIPHER_CTX *c = EVP_CIPHER_CTX_new();
    int used;
    memcpy(out, header, 16);
    assert_int_equal(EVP_EncryptInit_ex(c, EVP_aes_128_gcm(), NULL, key, nonce), 1);
    assert_int_equal(EVP_EncryptUpdate(c, NULL, &used, header, 16), 1);
    assert_int_equal(EVP_EncryptUpdate(c, out + 16, &used, (const uint8_t *)TEXT, TEXT_SIZE), 1);
    assert_int_equal(EVP_EncryptFinal_ex(c, out + 20, &used), 1);
    assert_int_equal(EVP_CIPHER_CTX_ctrl(c, EVP_CTRL_GCM_GET_TAG, 16, out + 20), 1);
    EVP_CIPHER_CTX_free(c);
}

static bool opens(struct seal *seal, const uint8_t *datagram, size_t size) {
    uint8_t message[2048];
    size_t message_size;
    uint64_t sequence;
    return seal_open(seal, datagram, size, message, &message_size, &sequence);
}

static bool opens_at(struct seal *seal, uint64_t sequence) {
    uint8_t datagram[SEALED_SIZE];
    seal_by_hand(&(struct seal_header){SEAL_TO_SERVER, EPOCH, CONNECTION, sequence}, datagram);
    return opens(seal, datagram, sizeof datagram);
}

static void what_is_sealed_opens_to_the_same_bytes_at_every_length(void **state) {
    (void)state;
    struct random random = {1};
    struct seal *here = to_server(), *there = to_server();
    uint64_t expected = 0;
    for (size_t size = 0; size < 1400; size += size < 70 ? 1 : 97) {
        uint8_t message[1400], datagram[1500], back[1400];
        for (size_t i = 0; i < size; i++)
            message[i] = (uint8_t)random_bits(&random);
        size_t sealed = seal_seal(here, message, size, datagram), back_size = 0;
        assert_int_equal(sealed, size + SEAL_OVERHEAD);
        uint64_t sequence = 0;
        assert_true(seal_open(there, datagram, sealed, back, &back_size, &sequence));
        assert_int_equal(sequence, expected++);
        assert_int_equal(back_size, size);
        assert_memory_equal(back, message, size);
    }
    seal_destroy(&here);
    seal_destroy(&there);
    assert_null(there);
}

// Made once by Python's cryptography: AESGCM(key).encrypt(iv xor 0x102, b"pose", header).
static const uint8_t known[SEALED_SIZE] = {
    0x01, 0x01, 0x07, 0x00, 0x01, 0x02, 0x03, 0x04, 0x00, 0x00, 0x00, 0x00,
    0x00, 0x00, 0x01, 0x02, 0xf1, 0xea, 0x0f, 0x81, 0xf4, 0xcd, 0x37, 0x5e,
    0x24, 0xb6, 0x0e, 0xdf, 0xc9, 0x8a, 0x2e, 0x41, 0x1e, 0x8f, 0xab, 0xf2,
};

static void sequence_0x102_is_the_known_answer(void **state) {
    (void)state;
    uint8_t by_hand[SEALED_SIZE], sealed[SEALED_SIZE];
    struct seal_header header = {SEAL_TO_SERVER, EPOCH, CONNECTION, 0x102};
    seal_by_hand(&header, by_hand);
    assert_memory_equal(by_hand, known, sizeof known);
    struct seal *seal = to_server();
    for (int i = 0; i <= 0x102; i++)
        seal_seal(seal, (const uint8_t *)TEXT, TEXT_SIZE, sealed);
    assert_memory_equal(sealed, known, sizeof known);
    seal_destroy(&seal);
}

static void the_clear_header_can_be_read_without_a_key(void **state) {
    (void)state;
    struct seal_header header;
    assert_true(seal_peek(known, sizeof known, &header));
    assert_int_equal(header.direction, SEAL_TO_SERVER);
    assert_int_equal(header.epoch, EPOCH);
    assert_int_equal(header.connection, CONNECTION);
    assert_int_equal(header.sequence, 0x102);
}

static void every_flipped_bit_is_refused_and_moves_nothing(void **state) {
    (void)state;
    struct seal *seal = to_server();
    for (int bit = 0; bit < 8 * SEALED_SIZE; bit++) {
        uint8_t flipped[SEALED_SIZE];
        memcpy(flipped, known, sizeof flipped);
        flipped[bit / 8] ^= (uint8_t)(1 << bit % 8);
        assert_false(opens(seal, flipped, sizeof flipped));
    }
    assert_true(opens(seal, known, sizeof known));
    seal_destroy(&seal);
}

static void every_other_length_is_refused(void **state) {
    (void)state;
    struct seal *seal = to_server();
    uint8_t longer[SEALED_SIZE + 8] = {0};
    memcpy(longer, known, sizeof known);
    for (size_t size = 0; size <= sizeof longer; size++) {
        // A copy of just this size, so that reading past it is found out.
        uint8_t *exact = malloc(size ? size : 1);
        memcpy(exact, longer, size);
        if (size != SEALED_SIZE)
            assert_false(opens(seal, exact, size));
        free(exact);
    }
    seal_destroy(&seal);
}

static void other_directions_epochs_connections_and_keys_are_refused(void **state) {
    (void)state;
    uint8_t other_key[SEAL_KEY_SIZE] = {1}, other_iv[SEAL_IV_SIZE] = {1};
    struct seal *others[] = {
        seal_create(SEAL_TO_STATION, EPOCH, CONNECTION, key, iv),
        seal_create(SEAL_TO_SERVER, EPOCH + 1, CONNECTION, key, iv),
        seal_create(SEAL_TO_SERVER, EPOCH, CONNECTION + 1, key, iv),
        seal_create(SEAL_TO_SERVER, EPOCH, CONNECTION, other_key, iv),
        seal_create(SEAL_TO_SERVER, EPOCH, CONNECTION, key, other_iv),
    };
    for (size_t i = 0; i < sizeof others / sizeof *others; i++) {
        assert_false(opens(others[i], known, sizeof known));
        seal_destroy(&others[i]);
    }
}

// ---- window -------------------------------------------------------------------------------------

static void a_replay_is_refused(void **state) {
    (void)state;
    struct seal *seal = to_server();
    for (uint64_t sequence = 0; sequence < 5; sequence++) {
        assert_true(opens_at(seal, sequence));
        assert_false(opens_at(seal, sequence));
    }
    assert_true(seal_has_seen(seal, 4));
    assert_false(seal_has_seen(seal, 5));
    seal_destroy(&seal);
}

static void one_1023_behind_opens_once_and_one_1024_behind_never(void **state) {
    (void)state;
    static const uint64_t newest[] = {1024, 1025, 5000, 65536 + 63, (1ull << 32) - 1};
    for (size_t i = 0; i < sizeof newest / sizeof *newest; i++) {
        struct seal *seal = to_server();
        assert_true(opens_at(seal, newest[i]));
        assert_true(opens_at(seal, newest[i] - 1023));
        assert_false(opens_at(seal, newest[i] - 1023));
        assert_false(opens_at(seal, newest[i] - 1024));
        seal_destroy(&seal);
    }
}

static void a_forged_high_sequence_does_not_move_the_window(void **state) {
    (void)state;
    struct seal *seal = to_server();
    assert_true(opens_at(seal, 3));
    uint8_t forged[SEALED_SIZE];
    seal_by_hand(&(struct seal_header){SEAL_TO_SERVER, EPOCH, CONNECTION, 1u << 30}, forged);
    forged[SEALED_SIZE - 1] ^= 1;
    assert_false(opens(seal, forged, sizeof forged));
    assert_true(opens_at(seal, 2));
    assert_true(opens_at(seal, 4));
    seal_destroy(&seal);
}

static void a_sequence_that_one_key_never_reaches_is_refused(void **state) {
    (void)state;
    struct seal *seal = to_server();
    assert_false(opens_at(seal, 1ull << 32));
    assert_false(opens_at(seal, UINT64_MAX));
    assert_true(opens_at(seal, 0));
    seal_destroy(&seal);
}

// The window against a set of all sequences ever opened, over jumps of all sizes.
static void the_window_accepts_what_a_full_memory_would(void **state) {
    (void)state;
    enum { RANGE = 20000 };
    static bool opened[RANGE];
    struct random random = {7};
    struct seal *seal = to_server();
    uint64_t newest = 0;
    bool any = false;
    for (int i = 0; i < 30000; i++) {
        double reach = random_between(&random, 0, 1) < 0.02 ? 1500 : 5;
        double at = (double)newest + random_between(&random, -1100, reach);
        uint64_t sequence = at < 0 ? 0 : (uint64_t)at;
        if (sequence >= RANGE)
            break;
        bool expected = !opened[sequence] && (!any || sequence + SEAL_WINDOW > newest);
        assert_int_equal(opens_at(seal, sequence), expected);
        opened[sequence] |= expected;
        any = true;
        newest = sequence > newest ? sequence : newest;
    }
    assert_true(newest > 15000);
    seal_destroy(&seal);
}

// ---- memory -------------------------------------------------------------------------------------

static size_t allocations;

static void *count_malloc(size_t size, const char *file, int line) {
    (void)file, (void)line;
    allocations++;
    return malloc(size);
}

static void *count_realloc(void *memory, size_t size, const char *file, int line) {
    (void)file, (void)line;
    allocations++;
    return realloc(memory, size);
}

static void just_free(void *memory, const char *file, int line) {
    (void)file, (void)line;
    free(memory);
}

static void sealing_and_opening_allocate_nothing(void **state) {
    (void)state;
    struct seal *here = to_server(), *there = to_server();
    assert_true(allocations > 0);
    size_t before = allocations;
    for (int i = 0; i < 100; i++) {
        uint8_t datagram[SEALED_SIZE];
        seal_seal(here, (const uint8_t *)TEXT, TEXT_SIZE, datagram);
        assert_true(opens(there, datagram, sizeof datagram));
        assert_false(opens(there, datagram, sizeof datagram));
        datagram[15] ^= 0x80;
        assert_false(opens(there, datagram, sizeof datagram));
    }
    assert_int_equal(allocations, before);
    seal_destroy(&here);
    seal_destroy(&there);
}

int main(void) {
    CRYPTO_set_mem_functions(count_malloc, count_realloc, just_free);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_sealed_opens_to_the_same_bytes_at_every_length),
        cmocka_unit_test(sequence_0x102_is_the_known_answer),
        cmocka_unit_test(the_clear_header_can_be_read_without_a_key),
        cmocka_unit_test(every_flipped_bit_is_refused_and_moves_nothing),
        cmocka_unit_test(every_other_length_is_refused),
        cmocka_unit_test(other_directions_epochs_connections_and_keys_are_refused),
        cmocka_unit_test(a_replay_is_refused),
        cmocka_unit_test(one_1023_behind_opens_once_and_one_1024_behind_never),
        cmocka_unit_test(a_forged_high_sequence_does_not_move_the_window),
        cmocka_unit_test(a_sequence_that_one_key_never_reaches_is_refused),
        cmocka_unit_test(the_window_accepts_what_a_full_memory_would),
        cmocka_unit_test(sealing_and_opening_allocate_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
