// The token of a request, and the browser's other cookies, from its headers.
#pragma once

#include <stdbool.h>

#define WEB_TOKEN_MAX 128

// The value of the cookie `arthron`, or of `Bearer`. False if there is none, or it cannot be a
// token.
bool token_of_cookies(const char *cookies, char out_token[WEB_TOKEN_MAX]);
bool token_of_device(const char *cookies, char out_token[WEB_TOKEN_MAX]);  // arthron-device
bool token_of_sign_on(const char *cookies, char out_token[WEB_TOKEN_MAX]); // arthron-sign-on
bool token_of_authorization(const char *authorization, char out_token[WEB_TOKEN_MAX]);
