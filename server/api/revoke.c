#include "api/revoke.h"

#include "api/forward.h"
#include "api/servers.h"
#include "base/check.h"
#include "base/log.h"
#include "net/authority.h"

#include <stdlib.h>
#include <string.h>

#define REVOCATIONS_PATH "/api/v1/peer/revocations"
#define AWAY_SIZE 256

struct revocation {
    struct api *api;
    char station[STORE_NAME_MAX];
    char serials[AUTHORITY_SERIALS_SIZE]; // that are known; it grows
    char away[AWAY_SIZE];                 // names of servers
};

void revoke_answer(struct web_response *response, const char *station, const char *serials,
                   const char *away) {
    struct api_call call = {.response = response};
    if (away[0])
        call_refuse(&call, 503, "away", NULL,
                    "Station %s is revoked, but not yet at these servers, which are away: %s. "
                    "Revoke it again once they are back.",
                    station, away);
    else if (!serials[0])
        call_refuse(&call, 409, "conflict", NULL, "Station %s has never had a certificate.",
                    station);
    else
        call_done(&call);
}

// ---- at the others ------------------------------------------------------------------------------

static bool contains(const char *serials, const char *serial, size_t length) {
    for (const char *at = serials; (at = strstr(at, serial)); at++) {
        bool begins = at == serials || at[-1] == ' ';
        if (begins && (at[length] == ' ' || !at[length]))
            return true;
    }
    return false;
}

static void merge(char serials[AUTHORITY_SERIALS_SIZE], const char *told) {
    size_t used = strlen(serials);
    for (const char *at = told + strspn(told, " "); *at; at += strspn(at, " ")) {
        char serial[64];
        size_t length = strcspn(at, " ");
        if (length >= sizeof serial || used + length + 2 > AUTHORITY_SERIALS_SIZE)
            return;
        memcpy(serial, at, length);
        serial[length] = '\0';
        if (!contains(serials, serial, length))
            used += (size_t)sprintf(serials + used, "%s%s", used ? " " : "", serial);
        at += length;
    }
}

static void note_away(struct revocation *r, const struct cluster_peer *peer) {
    size_t used = strlen(r->away);
    snprintf(r->away + used, sizeof r->away - used, "%s%s", used ? ", " : "", peer->name);
}

static bool tell_peer(struct revocation *r, const struct cluster_peer *peer) {
    json_t *body = json_pack("{s:s, s:s}", "station", r->station, "serials", r->serials), *told;
    struct error err;
    enum result result = forward_ask(r->api, peer, REVOCATIONS_PATH, body, &told, &err);
    const char *serials = json_string_value(json_object_get(told, "serials"));
    if (result == RESULT_OK && serials)
        merge(r->serials, serials);
    else
        log_warning("api", "station %s is not revoked at server %s: %s", r->station, peer->name,
                    result == RESULT_OK ? "its answer is none" : err.text);
    json_decref(told);
    json_decref(body);
    return result == RESULT_OK && serials;
}

// Twice where one tells of what an earlier one does not know.
static void tell_all(struct revocation *r) {
    struct cluster_peer *peers;
    int count = servers_read(r->api, &peers);
    size_t *known = alloc((size_t)count + 1, sizeof *known); // of the text; SIZE_MAX: it is away
    for (int round = 0; round < 2; round++)
        for (int i = 0; i < count; i++) {
            if (round && known[i] >= strlen(r->serials))
                continue;
            if (peers[i].lives && tell_peer(r, &peers[i])) {
                known[i] = strlen(r->serials);
            } else {
                known[i] = SIZE_MAX;
                note_away(r, &peers[i]);
            }
        }
    free(known);
    free(peers);
}

static void run_revocation(void *data, struct web_response *out) {
    struct revocation *r = data;
    struct error err;
    size_t before = strlen(r->serials);
    if (out) {
        tell_all(r);
        if (strlen(r->serials) > before && authority_revoke_all(r->api->config.keys_dir, r->station,
                                                                r->serials, &err) != RESULT_OK)
            log_error("api", "%s", err.text);
        revoke_answer(out, r->station, r->serials, r->away);
    }
    free(r);
}

void revoke_elsewhere(struct api_call *call, const char *station, const char *serials) {
    struct revocation *r = alloc(1, sizeof *r);
    r->api = call->api;
    snprintf(r->station, sizeof r->station, "%s", station);
    snprintf(r->serials, sizeof r->serials, "%s", serials);
    call->response->later = run_revocation;
    call->response->later_data = r;
}

// ---- here, for another one ----------------------------------------------------------------------

void post_peer_revocations(struct api_call *call) {
    static const char *const fields[] = {"station", "serials", NULL};
    char serials[AUTHORITY_SERIALS_SIZE];
    const char *station, *told;
    struct error err = {""};
    if (!call_take_body(call, fields) || !call_need_name(call, "station", &station) ||
        !call_need_text(call, "serials", &told))
        return;
    if ((size_t)snprintf(serials, sizeof serials, "%s", told) >= sizeof serials) {
        call_refuse(call, 413, "too_large", "serials", "These are too many.");
        return;
    }
    enum result result = authority_revoke_all(call->api->config.keys_dir, station, serials, &err);
    if (result == RESULT_OK || result == RESULT_MISSING)
        call_answer(call, 200, json_pack("{s:s}", "serials", serials));
    else
        call_check(call, result, &err);
}
