#include "commands/pinned_cases.h"

#include "base/check.h"
#include "base/log.h"
#include "peers/fetch.h"

#include <limits.h>
#include <stdlib.h>
#include <string.h>

#define PEERS_MAX 1024

struct settling {
    const struct sessions_config *config;
    struct peers *peers;
    struct cluster_peer *others;
    int other_count;
};

// Where it has another content, or none, *err says so.
static bool has_content(const struct session_case *one, struct error *err) {
    struct content_file files[CONTENT_FILES];
    char hash[CONTENT_HASH_SIZE];
    if (content_read(one->dir, files, err) != RESULT_OK)
        return false;
    content_hash(files, hash);
    if (!strcmp(hash, one->hash))
        return true;
    fail(err, RESULT_CORRUPT, "%s has the hash %.16s…, and not %.16s… of the config", one->dir,
         hash, one->hash);
    return false;
}

// Once, and only where a case is missing.
static enum result look_for_others(struct settling *s, struct error *err) {
    const struct cluster_settings *cluster = &s->config->cluster;
    char authority[SESSIONS_PATH_MAX + 16];
    if (s->peers)
        return RESULT_OK;
    snprintf(authority, sizeof authority, "%s/authority.pem", s->config->keys_dir);
    s->peers = peers_create(authority);
    s->others = alloc(PEERS_MAX, sizeof *s->others);
    return cluster_look(cluster, s->others, PEERS_MAX, &s->other_count, err);
}

static bool fetch_from(const struct settling *s, const struct session_case *one,
                       const struct cluster_peer *other) {
    const struct fetch_source source = {other->pages, other->secret};
    char kept[PATH_MAX + 32];
    struct error err;
    if (!strcmp(other->name, s->config->cluster.jet.name) || !other->pages[0])
        return false;
    enum result result =
        fetch_case(s->peers, &source, one->hash, one->dir, kept, sizeof kept, &err);
    if (result == RESULT_OK)
        log_info("server", "case %s: fetched from server %s%s%s", one->name, other->name,
                 kept[0] ? "; what was there is kept as " : "", kept);
    else if (result != RESULT_MISSING)
        log_warning("server", "case %s: server %s: %s", one->name, other->name, err.text);
    return result == RESULT_OK;
}

static enum result fetch(struct settling *s, const struct session_case *one, struct error *err) {
    struct error why;
    if (look_for_others(s, &why) != RESULT_OK)
        return fail_in(err, RESULT_MISSING, "case %s: other servers are not known (%s); ",
                       one->name, why.text);
    for (int i = 0; i < s->other_count; i++)
        if (fetch_from(s, one, &s->others[i]))
            return RESULT_OK;
    return fail_in(err, RESULT_MISSING, "case %s: no other server gave it; ", one->name);
}

static enum result settle_one(struct settling *s, const struct session_case *one,
                              struct error *err) {
    if (!one->hash[0] || has_content(one, err))
        return RESULT_OK;
    if (!s->config->cluster.jet.name[0])
        return fail_in(err, RESULT_MISSING, "case %s: ", one->name);
    return fetch(s, one, err);
}

enum result pinned_cases_settle(const struct sessions_config *config, struct error *err) {
    struct settling settling = {.config = config};
    enum result result = RESULT_OK;
    for (int i = 0; result == RESULT_OK && i < config->case_count; i++)
        result = settle_one(&settling, &config->cases[i], err);
    free(settling.others);
    peers_destroy(&settling.peers);
    return result;
}
