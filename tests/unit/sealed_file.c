// An encrypted file comes back as it was, by its passphrase alone, and whole or not at all.
#include "commands/sealed_file.h"

#include "test.h"
#include "unit/store_files.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define PASSPHRASE "correct horse battery"
#define PIECE 65536
#define HEADER (16 + 12 + 16 + 8 + 16)

static struct error err;

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
    const size_t changed[] = {0, 15, 19, 30, 45, HEADER - 1, HEADER, HEADER + PIECE, end - 1};
    for (size_t i = 0; i < sizeof changed / sizeof *changed; i++) {
        change(all, changed[i]);
        assert_int_not_equal(unseal(PASSPHRASE), RESULT_OK);
        assert_false(is_there("back"));
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
}

int main(void) {
    const struct CMUnitTest tests[] = {
#define TEST(f) cmocka_unit_test_setup_teardown(f, store_folder_begin, store_folder_end)
        TEST(files_of_every_size_come_back),   TEST(nothing_of_it_can_be_read),
        TEST(a_wrong_passphrase_is_called_so), TEST(every_change_is_found),
        TEST(pieces_cannot_change_places),     TEST(a_cost_without_bounds_is_refused),
        TEST(a_file_that_is_there_stays),
    };
    return cmocka_run_group_tests_name("sealed_file", tests, NULL, NULL);
}
