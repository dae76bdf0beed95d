#include "https/https.h"

#include "base/check.h"

static int look_for_end(void *user, curl_off_t a, curl_off_t b, curl_off_t c, curl_off_t d) {
    (void)a, (void)b, (void)c, (void)d;
    return atomic_load((const atomic_bool *)user);
}

static void set_trust(CURL *c, const char *authority, enum https_trust trust) {
    curl_easy_setopt(c, CURLOPT_PROTOCOLS_STR, "https");
    curl_easy_setopt(c, CURLOPT_SSLVERSION, (long)CURL_SSLVERSION_TLSv1_2);
    curl_easy_setopt(c, CURLOPT_SSL_VERIFYPEER, 1L);
    curl_easy_setopt(c, CURLOPT_SSL_VERIFYHOST, 2L);
    if (!authority[0])
        return;
    curl_easy_setopt(c, CURLOPT_CAINFO, authority);
    if (trust == HTTPS_AUTHORITY)
        curl_easy_setopt(c, CURLOPT_CAPATH, NULL); // the system's authorities are a folder
}

static void set_end(CURL *c, const atomic_bool *breaks_off) {
    curl_easy_setopt(c, CURLOPT_NOPROGRESS, 0L);
    curl_easy_setopt(c, CURLOPT_XFERINFOFUNCTION, look_for_end);
    curl_easy_setopt(c, CURLOPT_XFERINFODATA, breaks_off);
    curl_easy_setopt(c, CURLOPT_NOSIGNAL, 1L);
    curl_easy_setopt(c, CURLOPT_QUICK_EXIT, 1L); // a name server that hangs holds up no end
}

CURL *https_create(const char *authority, enum https_trust trust, const atomic_bool *breaks_off) {
    CURL *c = curl_easy_init();
    NEED(c, "memory");
    curl_easy_setopt(c, CURLOPT_FOLLOWLOCATION, 0L);
    set_trust(c, authority, trust);
    set_end(c, breaks_off);
    return c;
}
