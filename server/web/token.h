// The token of a request: who sent it.
#pragma once

#include <stdbool.h>

#define WEB_TOKEN_MAX 128

// The value of the cookie, or of `Bearer`; false where there is none, or it cannot be a token.
bool token_of_cookies(const char *cookies, char out_token[WEB_TOKEN_MAX]);
bool token_of_authorization(const char *authorization, char out_token[WEB_TOKEN_MAX]);
