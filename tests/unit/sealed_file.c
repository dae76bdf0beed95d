// An encrypted file comes back as it was, by its passphrase alone, and whole or not at all.
#include "commands/sealed_file.h"

#include "cheap_keys.h"
#include "test.h"
#include "unit/store_files.h"

#include <argon2.h>
#include <errno.h>
#include <openssl/evp.h>
#include <openssl/hmac.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define PASSPHRASE "correct horse battery"
#define PIECE 65536
#define HEADER (16 + 12 + 16 + 8 + 16)

static struct error err;

// The end of a piece is looked for with getc, which here fails when it is called so often.
static int failing_getc;
int __real_getc(FILE *file), __wrap_getc(FILE *file);

int __wrap_getc(FILE *file) {
    if (!failing_getc || --failing_getc)
        return __real_getc(file);
    file->_flags |= 0x20; // ferror
    errno = EIO;
    return EOF;
}

static char *make_bytes(size_t size) {
    char *bytes = malloc(size + 1);
    for (size_t i = 0; i < size; i++)
        bytes[i] = (char)(i * 7 + i / 251);
    return bytes;
}

static void drop(const char *name) {
    unlink(in_folder(name));
}

static enum result unseal(const char *passphrase) {
    drop("back");
    return sealed_file_read(in_folder("sealed"), passphrase, in_folder("back"), &err);
}

static bool is_there(const char *name) {
    return access(in_folder(name), F_OK) == 0;
}

static void make(size_t size) {
    char *bytes = make_bytes(size);
    put_file("plain", bytes, size);
    drop("sealed");
    assert_int_equal(sealed_file_write(in_folder("plain"), PASSPHRASE, in_folder("sealed"), &err),
                     RESULT_OK);
    free(bytes);
}

static void files_of_every_size_come_back(void **state) {
    (void)state;
    static const size_t sizes[] = {0, 1, PIECE, PIECE + 1};
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        size_t size, sealed_size;
        struct stat status;
        make(sizes[i]);
        free(get_file("sealed", &sealed_size));
        size_t pieces = sizes[i] ? (sizes[i] + PIECE - 1) / PIECE : 1;
        assert_int_equal(sealed_size, HEADER + sizes[i] + 16 * pieces);
        assert_true(sealed_file_is(in_folder("sealed")));
        assert_false(sealed_file_is(in_folder("plain")));
        assert_int_equal(unseal(PASSPHRASE), RESULT_OK);
        char *back = get_file("back", &size), *bytes = make_bytes(sizes[i]);
        assert_int_equal(size, sizes[i]);
        assert_memory_equal(back, bytes, size);
        assert_int_equal(stat(in_folder("sealed"), &status), 0);
        assert_int_equal(status.st_mode & 0777, 0600);
        free(back);
        free(bytes);
    }
}

// As the header file tells the layout, without the code of the product: what is in the piece.
static void open_piece(const uint8_t *file, const uint8_t keys[64], uint8_t number, bool last,
                       size_t size, uint8_t *out) {
    const uint8_t *piece = file + HEADER + (size_t)number * (PIECE + 16);
    uint8_t nonce[12] = {[10] = number, [11] = last};
    int used;
    memcpy(nonce, file + 44, 7);
    EVP_CIPHER_CTX *context = EVP_CIPHER_CTX_new();
    assert_int_equal(EVP_DecryptInit_ex(context, EVP_aes_256_gcm(), NULL, keys, nonce), 1);
    assert_int_equal(EVP_DecryptUpdate(context, NULL, &used, file, HEADER), 1);
    assert_int_equal(EVP_DecryptUpdate(context, out, &used, piece, (int)size), 1);
    assert_int_equal(EVP_CIPHER_CTX_ctrl(context, EVP_CTRL_GCM_SET_TAG, 16, (void *)(piece + size)),
                     1);
    assert_int_equal(EVP_DecryptFinal_ex(context, out + used, &used), 1);
    EVP_CIPHER_CTX_free(context);
}

static void it_is_as_its_layout_says(void **state) {
    (void)state;
    static const uint8_t begin[] = "arthron sealed\0\1\0\0\1\0\3\0\0\0\1\0\0"; // and a 0
    static uint8_t piece[PIECE];
    uint8_t keys[64], mac[32];
    size_t size;
    keys_cost_all = true;
    make(PIECE + 50);
    uint8_t *file = get_file("sealed", &size);
    char *bytes = make_bytes(PIECE + 50);
    assert_int_equal(size, HEADER + PIECE + 16 + 50 + 16);
    assert_memory_equal(file, begin, sizeof begin);
    assert_int_equal(file[51], 0);
    assert_int_equal(argon2id_hash_raw(3, 64 << 10, 1, PASSPHRASE, strlen(PASSPHRASE), file + 28,
                                       16, keys, sizeof keys),
                     ARGON2_OK);
    keys_cost_all = false;
    assert_non_null(HMAC(EVP_sha256(), keys + 32, 32, file, HEADER - 16, mac, NULL));
    assert_memory_equal(file + HEADER - 16, mac, 16);
    open_piece(file, keys, 0, false, PIECE, piece);
    assert_memory_equal(piece, bytes, PIECE);
    open_piece(file, keys, 1, true, 50, piece);
    assert_memory_equal(piece, bytes + PIECE, 50);
    free(bytes);
    free(file);
}

static void nothing_of_it_can_be_read(void **state) {
    (void)state;
    static char text[5000], other[5000];
    size_t size;
    for (size_t i = 0; i + 13 < sizeof text; i += 13)
        memcpy(text + i, "Ada Lovelace ", 13);
    put_file("plain", text, sizeof text);
    for (int i = 0; i < 2; i++) {
        drop("sealed");
        assert_int_equal(
            sealed_file_write(in_folder("plain"), PASSPHRASE, in_folder("sealed"), &err),
            RESULT_OK);
        assert_false(file_has("sealed", "Lovelace"));
        char *bytes = get_file("sealed", &size);
        assert_true(size > 5000);
        assert_memory_not_equal(bytes + HEADER, i ? other : text, 4000); // each time anew
        memcpy(other, bytes + HEADER, 4000);
        free(bytes);
    }
}

static void a_wrong_passphrase_is_called_so(void **state) {
    (void)state;
    static const char *const wrong[] = {"", "correct horse battery "};
    make(1000);
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        assert_int_equal(unseal(wrong[i]), RESULT_REFUSED);
        assert_non_null(strstr(err.text, "sealed: the passphrase is wrong"));
        assert_false(is_there("back"));
        assert_false(is_there("back.part"));
    }
}

// The file's size and one bit of it.
static void change(size_t keep, size_t at) {
    size_t size;
    char *bytes = get_file("whole", &size);
    if (at < size)
        bytes[at] ^= 4;
    put_file("sealed", bytes, keep < size ? keep : size);
    free(bytes);
}

static void every_change_is_found(void **state) {
    (void)state;
    make(2 * PIECE + 50);
    assert_int_equal(rename(in_folder("sealed"), in_folder("whole")), 0);
    const size_t end = HEADER + 2 * (PIECE + 16) + 50 + 16, all = end;
    static const struct {
        size_t at;
        enum result result;
    } rows[] = {
        {0, RESULT_FORMAT},
        {15, RESULT_FORMAT},
        {19, RESULT_CORRUPT}, // it would take all memory
        {30, RESULT_REFUSED},
        {45, RESULT_REFUSED},
        {HEADER - 16, RESULT_REFUSED},
        {HEADER - 1, RESULT_REFUSED},
        {HEADER, RESULT_CORRUPT},
        {HEADER + PIECE, RESULT_CORRUPT},
        {end - 1, RESULT_CORRUPT},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        change(all, rows[i].at);
        assert_int_equal(unseal(PASSPHRASE), rows[i].result);
        assert_false(is_there("back"));
        assert_false(is_there("back.part"));
    }
    const size_t cut[] = {0, HEADER - 1, HEADER, HEADER + PIECE + 16, end - 1};
    for (size_t i = 0; i < sizeof cut / sizeof *cut; i++) {
        change(cut[i], all);
        enum result result = unseal(PASSPHRASE);
        assert_int_equal(result, cut[i] < HEADER ? RESULT_FORMAT : RESULT_CORRUPT);
        assert_false(is_there("back"));
    }
    change(all, all);
    assert_int_equal(unseal(PASSPHRASE), RESULT_OK);
}

static void what_was_put_behind_is_found(void **state) {
    (void)state;
    static const size_t more[] = {1, 16, PIECE + 16};
    size_t size;
    make(2 * PIECE);
    char *bytes = get_file("sealed", &size);
    bytes = realloc(bytes, size + PIECE + 16);
    memcpy(bytes + size, bytes + HEADER, PIECE + 16); // a piece of its own
    for (size_t i = 0; i < sizeof more / sizeof *more; i++) {
        put_file("sealed", bytes, size + more[i]);
        assert_int_equal(unseal(PASSPHRASE), RESULT_CORRUPT);
        assert_false(is_there("back"));
    }
    free(bytes);
}

static void pieces_cannot_change_places(void **state) {
    (void)state;
    size_t size;
    make(3 * PIECE);
    char *bytes = get_file("sealed", &size), piece[PIECE + 16];
    memcpy(piece, bytes + HEADER, sizeof piece);
    memmove(bytes + HEADER, bytes + HEADER + sizeof piece, sizeof piece);
    memcpy(bytes + HEADER + sizeof piece, piece, sizeof piece);
    put_file("sealed", bytes, size);
    free(bytes);
    assert_int_equal(unseal(PASSPHRASE), RESULT_CORRUPT);
}

// Whoever wrote the header may ask for any cost: a file cannot take all memory.
static void a_cost_without_bounds_is_refused(void **state) {
    (void)state;
    static const struct {
        int at;
        unsigned char value;
    } rows[] = {{19, 0xff}, {23, 0x7f}, {24, 0}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        size_t size;
        make(10);
        char *bytes = get_file("sealed", &size);
        bytes[rows[i].at] = (char)rows[i].value;
        put_file("sealed", bytes, size);
        free(bytes);
        assert_int_equal(unseal(PASSPHRASE), RESULT_CORRUPT);
    }
}

static void a_disk_that_fails_is_no_end(void **state) {
    (void)state;
    make(2 * PIECE);
    for (int n = 1; n <= 2; n++) {
        failing_getc = n;
        assert_int_equal(unseal(PASSPHRASE), RESULT_IO);
        assert_false(is_there("back"));
        failing_getc = n;
        assert_int_equal(
            sealed_file_write(in_folder("plain"), PASSPHRASE, in_folder("other"), &err), RESULT_IO);
        assert_false(is_there("other"));
    }
}

static void a_file_that_is_there_stays(void **state) {
    (void)state;
    make(10);
    assert_int_equal(sealed_file_write(in_folder("plain"), PASSPHRASE, in_folder("sealed"), &err),
                     RESULT_REFUSED);
    assert_int_equal(sealed_file_read(in_folder("sealed"), PASSPHRASE, in_folder("plain"), &err),
                     RESULT_REFUSED);
    assert_int_equal(sealed_file_write(in_folder("none"), PASSPHRASE, in_folder("new"), &err),
                     RESULT_IO);
    assert_false(is_there("new"));
    assert_int_equal(symlink(in_folder("elsewhere"), in_folder("new.part")), 0);
    assert_int_equal(sealed_file_write(in_folder("plain"), PASSPHRASE, in_folder("new"), &err),
                     RESULT_IO);
    assert_false(is_there("elsewhere"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
#define TEST(f) cmocka_unit_test_setup_teardown(f, store_folder_begin, store_folder_end)
        TEST(files_of_every_size_come_back),   TEST(nothing_of_it_can_be_read),
        TEST(it_is_as_its_layout_says),        TEST(what_was_put_behind_is_found),
        TEST(a_wrong_passphrase_is_called_so), TEST(every_change_is_found),
        TEST(pieces_cannot_change_places),     TEST(a_cost_without_bounds_is_refused),
        TEST(a_file_that_is_there_stays),      TEST(a_disk_that_fails_is_no_end),
    };
    return cmocka_run_group_tests_name("sealed_file", tests, NULL, NULL);
}
