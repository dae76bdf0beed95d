#include "link/servers.h"

#include "base/clock.h"
#include "base/number.h"

#include <stdio.h>
#include <string.h>
#include <strings.h>

#define STEADY_NS (5 * NS_PER_S) // a connection that ends sooner changes no count
#define ASK_MIN_MS 50
#define ASK_MAX_MS 10000
#define TAKEOVER_MS 500 // a server that names a silent one is asked again after so long

bool server_parse(const char *text, struct server_address *out) {
    const char *colon = strrchr(text, ':');
    int64_t port;
    if (!colon || colon == text || !number_int(colon + 1, 1, 65535, &port))
        return false;
    bool bracketed = text[0] == '[' && colon[-1] == ']';
    const char *start = text + bracketed;
    size_t length = (size_t)(colon - text) - 2 * (size_t)bracketed;
    if (!length || length >= sizeof out->host)
        return false;
    memcpy(out->host, start, length);
    out->host[length] = '\0';
    out->port = (int)port;
    return true;
}

void server_write(const struct server_address *server, char out[SERVER_TEXT_SIZE]) {
    bool brackets = strchr(server->host, ':') != NULL;
    snprintf(out, SERVER_TEXT_SIZE, brackets ? "[%s]:%d" : "%s:%d", server->host, server->port);
}

int servers_parse(const char *text, struct server_address out[SERVERS_MAX]) {
    static const char blank[] = " \t";
    for (int count = 0; count < SERVERS_MAX;) {
        char one[SERVER_TEXT_SIZE];
        text += strspn(text, blank);
        size_t length = strcspn(text, ", \t");
        if (length >= sizeof one)
            return 0;
        memcpy(one, text, length);
        one[length] = '\0';
        if (!server_parse(one, &out[count++]))
            return 0;
        text += length;
        text += strspn(text, blank);
        if (!*text)
            return count;
        if (*text++ != ',')
            return 0;
    }
    return 0;
}

void servers_init(struct servers *s, const struct server_address *list, int count) {
    *s = (struct servers){.count = count, .named_by = -1};
    memcpy(s->list, list, (size_t)count * sizeof *list);
}

const struct server_address *servers_present(const struct servers *s) {
    return &s->list[s->present];
}

bool servers_has_other(const struct servers *s) {
    return s->count > 1 || s->present == s->count;
}

// ---- sessions and their tokens ------------------------------------------------------------------

static uint64_t *token_of(struct servers *s, const uint8_t id[16]) {
    for (int i = 0; i < s->session_count; i++)
        if (!memcmp(s->sessions[i].id, id, sizeof s->sessions[i].id))
            return &s->sessions[i].token;
    return NULL;
}

static void remember(struct servers *s, const uint8_t id[16], uint64_t token) {
    memcpy(s->sessions[s->next].id, id, sizeof s->sessions[s->next].id);
    s->sessions[s->next].token = token;
    s->next = (s->next + 1) % SERVERS_SESSIONS;
    s->session_count += s->session_count < SERVERS_SESSIONS;
}

static bool is_new_enough(struct servers *s, const uint8_t id[16], uint64_t token) {
    uint64_t *known = token_of(s, id);
    if (!token)
        return true;
    if (!known)
        remember(s, id, token);
    else if (token < *known)
        return false;
    else
        *known = token;
    return true;
}

static void note_answer(struct servers *s) {
    if (s->present < s->count)
        s->first = s->present;
}

bool servers_welcomed(struct servers *s, const uint8_t session_id[16], uint64_t token,
                      int64_t now_ns) {
    if (!is_new_enough(s, session_id, token))
        return false;
    s->welcomed_ns = now_ns;
    note_answer(s);
    return true;
}

// ---- the next one -------------------------------------------------------------------------------

static void begin_anew(struct servers *s) {
    s->tried = s->silent = 0;
    s->followed = s->asked = 0;
}

// The connection to the present one is over.
static void leave(struct servers *s, int64_t now_ns) {
    if (s->welcomed_ns && now_ns - s->welcomed_ns >= STEADY_NS)
        begin_anew(s);
    s->welcomed_ns = 0;
    s->tried |= 1U << s->present;
}

static int untried(const struct servers *s) {
    for (int k = 0; k < s->count; k++) {
        int i = (s->first + k) % s->count;
        if (!(s->tried & 1U << i))
            return i;
    }
    return -1;
}

static int next(struct servers *s) {
    int server = untried(s);
    bool all = server < 0;
    if (all)
        begin_anew(s);
    s->present = all ? s->first : server;
    s->asked = 0;
    s->named_by = -1;
    return all ? SERVERS_BACK_OFF : 0;
}

static int ask(struct servers *s, int server, int after_ms) {
    if (++s->asked > SERVERS_ASKED_MAX)
        return next(s);
    s->present = server;
    s->followed = 0;
    s->named_by = -1;
    return after_ms;
}

int servers_lost(struct servers *s, bool was_silent, int64_t now_ns) {
    int namer = s->welcomed_ns ? -1 : s->named_by;
    leave(s, now_ns);
    if (was_silent)
        s->silent |= 1U << s->present;
    return namer >= 0 && untried(s) < 0 ? ask(s, namer, TAKEOVER_MS) : next(s);
}

int servers_ask_again(struct servers *s, uint32_t after_ms, int64_t now_ns) {
    leave(s, now_ns);
    note_answer(s);
    return ask(s, s->present,
               after_ms < ASK_MIN_MS   ? ASK_MIN_MS
               : after_ms > ASK_MAX_MS ? ASK_MAX_MS
                                       : (int)after_ms);
}

static bool is_same(const struct server_address *a, const struct server_address *b) {
    return a->port == b->port && !strcasecmp(a->host, b->host);
}

// Its place, which for one that the list does not have is behind the list.
static int place_of(struct servers *s, const struct server_address *to) {
    int i = 0;
    while (i <= s->count && !is_same(&s->list[i], to))
        i++;
    if (i <= s->count)
        return i;
    s->list[s->count] = *to;
    s->silent &= ~(1U << s->count);
    return s->count;
}

int servers_elsewhere(struct servers *s, const struct server_address *to, int64_t now_ns) {
    leave(s, now_ns);
    if (!to || s->followed == SERVERS_FOLLOWED_MAX)
        return next(s);
    note_answer(s);
    int from = s->present;
    bool itself = is_same(&s->list[from], to);
    int place = place_of(s, to);
    if (itself || s->silent & 1U << place)
        return untried(s) < 0 ? ask(s, from, TAKEOVER_MS) : next(s);
    s->followed++;
    s->present = place;
    s->named_by = from < s->count ? from : -1;
    return 0;
}
