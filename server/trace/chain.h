// The chain of hashes through a trace, for this room and for tests that forge.
#pragma once

#include "trace/trace.h"

struct evp_md_ctx_st; // OpenSSL's EVP_MD_CTX
struct evp_md_st;     // OpenSSL's EVP_MD

struct chain {
    uint8_t value[TRACE_HASH_SIZE];
    struct evp_md_ctx_st *context;
    struct evp_md_st *sha256;
};

void chain_init(struct chain *chain); // its value is 0
void chain_fini(struct chain *chain);

// value = SHA-256(value, data). Allocates nothing.
void chain_add(struct chain *chain, const void *data, size_t size);
