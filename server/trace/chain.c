#include "trace/chain.h"

#include "base/check.h"

#include <openssl/evp.h>
#include <string.h>

void chain_init(struct chain *chain) {
    memset(chain, 0, sizeof *chain);
    chain->context = EVP_MD_CTX_new();
    chain->sha256 = EVP_MD_fetch(NULL, "SHA256", NULL);
    NEED(chain->context && chain->sha256, "memory");
    chain_add(chain, NULL, 0); // the context takes its memory with the first
    memset(chain->value, 0, sizeof chain->value);
}

void chain_fini(struct chain *chain) {
    EVP_MD_CTX_free(chain->context);
    EVP_MD_free(chain->sha256);
}

void chain_add(struct chain *chain, const void *data, size_t size) {
    bool done = EVP_DigestInit_ex2(chain->context, chain->sha256, NULL) == 1 &&
                EVP_DigestUpdate(chain->context, chain->value, sizeof chain->value) == 1 &&
                EVP_DigestUpdate(chain->context, data, size) == 1 &&
                EVP_DigestFinal_ex(chain->context, chain->value, NULL) == 1;
    NEED(done, "memory");
}
