// A request of this server to another one, over HTTPS alone, with libcurl: what each of them keeps
// to. The rest of the request is its room's.
#pragma once

#include <curl/curl.h>
#include <stdatomic.h>

// Whose certificates the other server may have. It must be for the host of the address.
enum https_trust {
    HTTPS_AUTHORITY, // of the authorities in the file alone; without a file, the system's
    HTTPS_AUTHORITY_AND_SYSTEM, // both
};

// authority: a PEM file; empty: none. TLS 1.2 at least. No redirect is followed, and no signal is
// used. breaks_off: as long as the handle lives. Once it is true, the request ends within a second
// with CURLE_ABORTED_BY_CALLBACK. The caller ends the handle with curl_easy_cleanup. From any
// thread.
CURL *https_create(const char *authority, enum https_trust trust, const atomic_bool *breaks_off);
