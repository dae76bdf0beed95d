#include "view/admission.h"

#include <openssl/crypto.h>
#include <string.h>

enum { BAD_REQUEST = 400, FORBIDDEN = 403, NOT_FOUND = 404 };

static bool is_host(const char *host, const char *name) {
    size_t length = strlen(name);
    if (strncasecmp(host, name, length))
        return false;
    const char *port = host + length;
    return !*port || (*port == ':' && strspn(port + 1, "0123456789") == strlen(port + 1));
}

static bool origin_is_listed(const struct view_config *config, const char *origin) {
    if (!*origin)
        return true; // a program, not a page
    for (int i = 0; i < config->origin_count; i++)
        if (!strcmp(config->origins[i], origin))
            return true;
    return false;
}

int admission_status(const struct view_config *config, const char token[TOKEN_LENGTH + 1],
                     const struct admission_request *request) {
    if (!is_host(request->host, "localhost") && !is_host(request->host, "127.0.0.1"))
        return FORBIDDEN;
    if (strcmp(request->path, "/view"))
        return NOT_FOUND;
    if (strlen(request->token) != TOKEN_LENGTH ||
        CRYPTO_memcmp(request->token, token, TOKEN_LENGTH))
        return FORBIDDEN;
    if (!origin_is_listed(config, request->origin))
        return FORBIDDEN;
    return strcmp(request->subprotocol, WIRE_VIEW_SUBPROTOCOL) ? BAD_REQUEST : 0;
}
