#include "api/password.h"

#include "base/chance.h"
#include "base/check.h"

#include <argon2.h>
#include <pthread.h>
#include <string.h>

#define MEMORY_KIB (64 * 1024)
#define PASSES 3
#define LANES 1
#define SALT 16
#define HASH 32
#define AT_ONCE 2

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t freed = PTHREAD_COND_INITIALIZER;
static int running;

static void enter(void) {
    pthread_mutex_lock(&lock);
    while (running == AT_ONCE)
        pthread_cond_wait(&freed, &lock);
    running++;
    pthread_mutex_unlock(&lock);
}

static void leave(void) {
    pthread_mutex_lock(&lock);
    running--;
    pthread_cond_signal(&freed);
    pthread_mutex_unlock(&lock);
}

enum result password_check(const char *password, struct error *err) {
    size_t characters = 0;
    for (const char *c = password; *c; c++)
        characters += ((unsigned char)*c & 0xc0) != 0x80;
    if (characters < PASSWORD_LEAST)
        return fail(err, RESULT_INVALID, "A password has at least %d characters.", PASSWORD_LEAST);
    if (strlen(password) > PASSWORD_MOST)
        return fail(err, RESULT_INVALID, "A password has at most %d bytes.", PASSWORD_MOST);
    return RESULT_OK;
}

static enum result no_memory(struct error *err) {
    return fail(err, RESULT_LIMIT, "there is no memory for a password now");
}

enum result password_encode(const char *password, char out_encoded[PASSWORD_ENCODED],
                            struct error *err) {
    uint8_t salt[SALT];
    chance_fill(salt, sizeof salt);
    if (memory_is_short())
        return no_memory(err);
    enter();
    int code = argon2id_hash_encoded(PASSES, MEMORY_KIB, LANES, password, strlen(password), salt,
                                     sizeof salt, HASH, out_encoded, PASSWORD_ENCODED);
    leave();
    CHECK(code == ARGON2_OK || code == ARGON2_MEMORY_ALLOCATION_ERROR);
    return code == ARGON2_OK ? RESULT_OK : no_memory(err);
}

enum result password_is(const char *encoded, const char *password, bool *out_right,
                        struct error *err) {
    static const uint8_t salt[SALT];
    uint8_t hash[HASH];
    size_t length = strlen(password);
    *out_right = false;
    if (memory_is_short())
        return no_memory(err);
    enter();
    int code = encoded ? argon2id_verify(encoded, password, length)
                       : argon2id_hash_raw(PASSES, MEMORY_KIB, LANES, password, length, salt, SALT,
                                           hash, HASH);
    leave();
    *out_right = encoded && code == ARGON2_OK;
    return code == ARGON2_MEMORY_ALLOCATION_ERROR ? no_memory(err) : RESULT_OK;
}
