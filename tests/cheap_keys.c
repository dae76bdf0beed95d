#include "cheap_keys.h"

#include "base/check.h"

#include <argon2.h>

bool keys_cost_all;

typedef int make_key(uint32_t passes, uint32_t memory_kib, uint32_t lanes, const void *passphrase,
                     size_t passphrase_size, const void *salt, size_t salt_size, void *hash,
                     size_t hash_size);

make_key __real_argon2id_hash_raw, __wrap_argon2id_hash_raw;

int __wrap_argon2id_hash_raw(uint32_t passes, uint32_t memory_kib, uint32_t lanes,
                             const void *passphrase, size_t passphrase_size, const void *salt,
                             size_t salt_size, void *hash, size_t hash_size) {
    CHECK(passes >= 1 && passes <= 16 && lanes >= 1 && lanes <= 16);
    CHECK(memory_kib >= 8 * lanes && memory_kib <= 1 << 20);
    return __real_argon2id_hash_raw(keys_cost_all ? passes : 1, keys_cost_all ? memory_kib : 8,
                                    keys_cost_all ? lanes : 1, passphrase, passphrase_size, salt,
                                    salt_size, hash, hash_size);
}
