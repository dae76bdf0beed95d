#include "api/device.h"

#include "base/chance.h"
#include "base/check.h"
#include "base/clock.h"
#include "store/store.h"

#include <inttypes.h>
#include <openssl/crypto.h>
#include <stdio.h>
#include <string.h>

#define HEAD 32 // digits: when it was made, and its number

static void sign(const struct secret_key *key, const char *who, const char head[HEAD + 1],
                 char out_hash[SECRET_MAX]) {
    char text[STORE_NAME_MAX + HEAD + 2];
    snprintf(text, sizeof text, "%s %s", head, who);
    secret_keyed_hash(key, "device", text, out_hash);
}

void device_make(const struct secret_key *key, const char *who, int64_t now_utc_ns,
                 char out_device[DEVICE_MAX]) {
    uint64_t number;
    char head[HEAD + 1], hash[SECRET_MAX];
    CHECK(strlen(who) < STORE_NAME_MAX);
    chance_fill(&number, sizeof number);
    snprintf(head, sizeof head, "%016" PRIx64 "%016" PRIx64, (uint64_t)now_utc_ns, number);
    sign(key, who, head, hash);
    snprintf(out_device, DEVICE_MAX, "%s%s", head, hash);
}

bool device_is_known(const struct secret_key *key, const char *device, const char *who,
                     int64_t now_utc_ns, char out_id[DEVICE_ID_MAX]) {
    char head[HEAD + 1] = "", hash[SECRET_MAX];
    uint64_t made_utc_ns;
    if (!device || strlen(device) != DEVICE_MAX - 1 || strlen(who) >= STORE_NAME_MAX)
        return false;
    memcpy(head, device, HEAD);
    sign(key, who, head, hash);
    if (CRYPTO_memcmp(hash, device + HEAD, SECRET_MAX - 1) != 0 ||
        sscanf(head, "%16" SCNx64, &made_utc_ns) != 1)
        return false;
    memcpy(out_id, head + HEAD / 2, DEVICE_ID_MAX);
    int64_t age_ns = now_utc_ns - (int64_t)made_utc_ns;
    return age_ns < DEVICE_S * NS_PER_S;
}
