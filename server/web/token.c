#include "web/token.h"

#include <ctype.h>
#include <string.h>
#include <strings.h>

// RFC 6750, 2.1
static bool take_token(const char *text, size_t length, char out_token[WEB_TOKEN_MAX]) {
    if (length == 0 || length >= WEB_TOKEN_MAX)
        return false;
    for (size_t i = 0; i < length; i++)
        if (!isalnum((unsigned char)text[i]) && !strchr("-._~+/=", text[i]))
            return false;
    memcpy(out_token, text, length);
    out_token[length] = '\0';
    return true;
}

// name: with its "=".
static bool take_cookie(const char *cookies, const char *name, char out_token[WEB_TOKEN_MAX]) {
    size_t name_length = strlen(name);
    for (const char *at = cookies; *at;) {
        at += strspn(at, "; ");
        size_t length = strcspn(at, "; ");
        if (!strncmp(at, name, name_length))
            return take_token(at + name_length, length - name_length, out_token);
        at += length;
    }
    return false;
}

bool token_of_cookies(const char *cookies, char out_token[WEB_TOKEN_MAX]) {
    return take_cookie(cookies, "arthron=", out_token);
}

bool token_of_device(const char *cookies, char out_token[WEB_TOKEN_MAX]) {
    return take_cookie(cookies, "arthron-device=", out_token);
}

bool token_of_sign_on(const char *cookies, char out_token[WEB_TOKEN_MAX]) {
    return take_cookie(cookies, "arthron-sign-on=", out_token);
}

bool token_of_authorization(const char *authorization, char out_token[WEB_TOKEN_MAX]) {
    static const char scheme[] = "Bearer ";
    if (strncasecmp(authorization, scheme, sizeof scheme - 1))
        return false;
    const char *token = authorization + sizeof scheme - 1;
    return take_token(token, strlen(token), out_token);
}
