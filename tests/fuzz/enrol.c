// What somebody without a certificate sends, and a signature under a trace: a first byte says
// which.
#include "base/check.h"
#include "fuzz/fuzz.h"
#include "net/certificate.h"
#include "trace/trace.h"
#include "wire/code.h"

#include <stdio.h>
#include <string.h>

static void request(const uint8_t *data, size_t size) {
    char name[CERTIFICATE_NAME_SIZE];
    EVP_PKEY *key = certificate_request_key(data, size, name);
    CHECK(memchr(name, 0, sizeof name));
    EVP_PKEY_free(key);
}

static void code(const uint8_t *data, size_t size) {
    char text[256], again[CODE_TEXT_MAX];
    struct code read, same;
    snprintf(text, sizeof text, "%.*s", (int)(size < 255 ? size : 255), (const char *)data);
    if (code_read(text, &read, NULL) != RESULT_OK)
        return;
    code_write(&read, again);
    CHECK(code_read(again, &same, NULL) == RESULT_OK);
    CHECK(!memcmp(&read, &same, sizeof read));
}

// A certificate, of which the first two bytes have the size, and a signature.
static void seal(const uint8_t *data, size_t size) {
    char signed_by[TRACE_SIGNED_BY_MAX];
    struct trace_seal s = {0};
    size_t certificate = size < 2 ? 0 : (size_t)data[0] << 8 | data[1];
    if (size < 2 || certificate > size - 2 || certificate > TRACE_CERTIFICATE_MAX)
        return;
    s.certificate = data + 2;
    s.certificate_size = certificate;
    s.signature = data + 2 + certificate;
    s.signature_size = size - 2 - certificate;
    CHECK(trace_seal_check(&s, NULL, 0, signed_by, NULL) != RESULT_OK); // nobody can guess one
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    if (size && data[0] == 'r')
        request(data + 1, size - 1);
    else if (size && data[0] == 'c')
        code(data + 1, size - 1);
    else if (size && data[0] == 's')
        seal(data + 1, size - 1);
    return 0;
}
