#include "signon/provider.h"

#include "base/check.h"
#include "base/clock.h"
#include "https/https.h"
#include "signon/signon.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#define CONNECT_MS 5000
#define PATIENCE_MS 10000
#define ANSWER_MAX 65536
#define KEPT_NS (3600 * NS_PER_S)

static const char discovery[] = "/.well-known/openid-configuration";

struct provider {
    const struct signon_settings *settings;
    atomic_bool breaks_off;
    pthread_mutex_t lock;          // of what follows
    struct provider_places places; // until then
    int64_t until_ns;
};

struct provider *provider_create(const struct signon_settings *settings) {
    struct provider *p = alloc(1, sizeof *p);
    p->settings = settings;
    pthread_mutex_init(&p->lock, NULL);
    curl_global_init(CURL_GLOBAL_DEFAULT);
    return p;
}

void provider_break_off(struct provider *p) {
    atomic_store(&p->breaks_off, true);
}

void provider_destroy(struct provider **provider) {
    if (*provider)
        pthread_mutex_destroy(&(*provider)->lock);
    free(*provider);
    *provider = NULL;
}

// ---- one request --------------------------------------------------------------------------------

struct transfer {
    const char *url, *form, *user, *password; // all but url may be NULL
    size_t size;
    char answer[ANSWER_MAX];
};

static size_t take_answer(char *bytes, size_t size, size_t count, void *user) {
    struct transfer *t = user;
    (void)size; // 1
    if (count > ANSWER_MAX - t->size)
        return 0;
    memcpy(t->answer + t->size, bytes, count);
    t->size += count;
    return count;
}

static void set_request(CURL *c, struct transfer *t) {
    curl_easy_setopt(c, CURLOPT_CONNECTTIMEOUT_MS, (long)CONNECT_MS);
    curl_easy_setopt(c, CURLOPT_TIMEOUT_MS, (long)PATIENCE_MS);
    curl_easy_setopt(c, CURLOPT_URL, t->url);
    curl_easy_setopt(c, CURLOPT_WRITEFUNCTION, take_answer);
    curl_easy_setopt(c, CURLOPT_WRITEDATA, t);
    if (t->form)
        curl_easy_setopt(c, CURLOPT_POSTFIELDS, t->form);
    if (!t->user)
        return;
    curl_easy_setopt(c, CURLOPT_HTTPAUTH, (long)CURLAUTH_BASIC);
    curl_easy_setopt(c, CURLOPT_USERNAME, t->user);
    curl_easy_setopt(c, CURLOPT_PASSWORD, t->password);
}

static enum result result_of(CURLcode code) {
    switch (code) {
    case CURLE_OK:
        return RESULT_OK;
    case CURLE_ABORTED_BY_CALLBACK:
        return RESULT_CLOSED;
    case CURLE_WRITE_ERROR:
        return RESULT_LIMIT;
    default:
        return RESULT_TIMEOUT;
    }
}

// Only a grant that is not valid is the browser's fault (RFC 6749, 5.2).
static enum result refuse(const json_t *answer, const char *url, long status, struct error *err) {
    const char *word = json_string_value(json_object_get(answer, "error"));
    bool is_told = word && signon_is_word(word);
    bool is_grant = is_told && !strcmp(word, "invalid_grant");
    return fail(err, is_grant ? RESULT_REFUSED : RESULT_FORMAT, "%s: status %ld %s", url, status,
                is_told ? word : "");
}

static enum result read_answer(const struct transfer *t, long status, json_t **out,
                               struct error *err) {
    json_t *answer = json_loadb(t->answer, t->size, JSON_REJECT_DUPLICATES, NULL);
    if (status == 200 && json_is_object(answer)) {
        *out = answer;
        return RESULT_OK;
    }
    enum result result = status == 200
                             ? fail(err, RESULT_FORMAT, "%s: the answer is no JSON object", t->url)
                             : refuse(answer, t->url, status, err);
    json_decref(answer);
    return result;
}

static enum result perform(CURL *c, struct transfer *t, json_t **out, struct error *err) {
    char why[CURL_ERROR_SIZE] = "";
    long status = 0;
    curl_easy_setopt(c, CURLOPT_ERRORBUFFER, why);
    CURLcode code = curl_easy_perform(c);
    enum result result = result_of(code);
    if (result == RESULT_LIMIT)
        return fail(err, result, "%s: the answer has more than %d bytes", t->url, ANSWER_MAX);
    if (result != RESULT_OK)
        return fail(err, result, "%s: %s", t->url, why[0] ? why : curl_easy_strerror(code));
    curl_easy_getinfo(c, CURLINFO_RESPONSE_CODE, &status);
    return read_answer(t, status, out, err);
}

static enum result ask(struct provider *p, const char *url, const char *form, const char *user,
                       const char *password, json_t **out, struct error *err) {
    struct transfer *t = alloc(1, sizeof *t);
    t->url = url;
    t->form = form;
    t->user = user;
    t->password = password;
    CURL *c = https_create(p->settings->authority, HTTPS_AUTHORITY, &p->breaks_off);
    set_request(c, t);
    enum result result = perform(c, t, out, err);
    curl_easy_cleanup(c);
    explicit_bzero(t->answer, sizeof t->answer);
    free(t);
    return result;
}

enum result provider_post(struct provider *p, const char *url, const char *form, const char *user,
                          const char *password, json_t **out, struct error *err) {
    return ask(p, url, form, user, password, out, err);
}

// ---- discovery ----------------------------------------------------------------------------------

static bool is_https(const char *text) {
    CURLU *url = curl_url();
    char *user = NULL, *fragment = NULL;
    NEED(url, "memory");
    bool is =
        !strncmp(text, "https://", 8) && curl_url_set(url, CURLUPART_URL, text, 0) == CURLUE_OK;
    bool has_user = curl_url_get(url, CURLUPART_USER, &user, 0) == CURLUE_OK;
    bool has_fragment = curl_url_get(url, CURLUPART_FRAGMENT, &fragment, 0) == CURLUE_OK;
    curl_free(user);
    curl_free(fragment);
    curl_url_cleanup(url);
    return is && !has_user && !has_fragment;
}

bool provider_is_url(const char *text) {
    for (const char *at = text; *at; at++)
        if (*at <= ' ' || *at > '~')
            return false;
    return strlen(text) < PROVIDER_URL_MAX && is_https(text);
}

static enum result take_place(const json_t *answer, const char *key, char out[PROVIDER_URL_MAX],
                              struct error *err) {
    const char *text = json_string_value(json_object_get(answer, key));
    if (!text || !provider_is_url(text))
        return fail(err, RESULT_FORMAT, "its %s is not an address like https://sso.example.org/at",
                    key);
    memcpy(out, text, strlen(text) + 1);
    return RESULT_OK;
}

static bool lists(const json_t *list, const char *word) {
    for (size_t i = 0; i < json_array_size(list); i++) {
        const char *text = json_string_value(json_array_get(list, i));
        if (text && !strcmp(text, word))
            return true;
    }
    return false;
}

// Without a list it takes Basic (OpenID Connect Discovery, 3).
static enum result choose_way(const json_t *answer, bool has_secret, bool *out_by_post,
                              struct error *err) {
    const json_t *ways = json_object_get(answer, "token_endpoint_auth_methods_supported");
    *out_by_post = ways && !lists(ways, "client_secret_basic");
    if (has_secret && *out_by_post && !lists(ways, "client_secret_post"))
        return fail(err, RESULT_VERSION,
                    "it takes a secret neither by client_secret_basic nor by client_secret_post");
    return RESULT_OK;
}

static enum result read_places(const struct signon_settings *settings, const json_t *answer,
                               struct provider_places *out, struct error *err) {
    const char *issuer = json_string_value(json_object_get(answer, "issuer"));
    if (!issuer || strcmp(issuer, settings->issuer) != 0)
        return fail(err, RESULT_FORMAT, "it calls itself by another issuer than the config");
    enum result result = take_place(answer, "authorization_endpoint", out->authorization, err);
    if (result == RESULT_OK)
        result = take_place(answer, "token_endpoint", out->token, err);
    if (result == RESULT_OK)
        result = choose_way(answer, settings->client_secret[0], &out->by_post, err);
    return result;
}

static enum result discover(struct provider *p, struct provider_places *out, struct error *err) {
    char url[SIGNON_TEXT_MAX + sizeof discovery];
    json_t *answer;
    const char *issuer = p->settings->issuer;
    size_t length = strlen(issuer);
    if (issuer[length - 1] == '/')
        length--;
    snprintf(url, sizeof url, "%.*s%s", (int)length, issuer, discovery);
    enum result result = ask(p, url, NULL, NULL, NULL, &answer, err);
    if (result != RESULT_OK)
        return result;
    result = read_places(p->settings, answer, out, err);
    json_decref(answer);
    return result == RESULT_OK ? result : fail_in(err, result, "%s: ", url);
}

// Nobody waits with the lock: two may ask at the same time.
enum result provider_places(struct provider *p, struct provider_places *out, struct error *err) {
    pthread_mutex_lock(&p->lock);
    bool known = clock_now_ns() < p->until_ns;
    *out = p->places;
    pthread_mutex_unlock(&p->lock);
    if (known)
        return RESULT_OK;
    enum result result = discover(p, out, err);
    if (result != RESULT_OK)
        return result;
    pthread_mutex_lock(&p->lock);
    p->places = *out;
    p->until_ns = clock_now_ns() + KEPT_NS;
    pthread_mutex_unlock(&p->lock);
    return RESULT_OK;
}
