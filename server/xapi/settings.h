// What the server's config says of xAPI.
#pragma once

#include <stdbool.h>

#define XAPI_PATH_MAX 256
#define XAPI_SITE_MAX 257
#define XAPI_USER_MAX 128

// The section [xapi] of the server's config.
struct xapi_settings {
    char file[XAPI_PATH_MAX]; // empty: no statements
    char site[XAPI_SITE_MAX];
    char server[XAPI_PATH_MAX]; // of the learning record store; empty: none
    char user[XAPI_USER_MAX];
    char password[XAPI_PATH_MAX], authority[XAPI_PATH_MAX]; // files
    bool names;
};
