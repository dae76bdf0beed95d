#include "hub/hub.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "hub/copied.h"
#include "hub/grades.h"
#include "hub/seat.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

int hub_find_case(const struct hub_config *config, const char *name) {
    for (int i = 0; i < config->case_count; i++)
        if (!strcmp(config->cases[i].name, name))
            return i;
    return -1;
}

int hub_find_station(const struct hub_config *config, const char *name) {
    for (int i = 0; i < config->station_count; i++)
        if (!strcmp(config->stations[i].name, name))
            return i;
    return -1;
}

static enum result load_scenes(struct hub *hub, struct error *err) {
    struct case_limits limits = case_limits_default();
    uint64_t hashes[HUB_CASES_MAX];
    for (int i = 0; i < hub->config.case_count; i++) {
        const struct hub_case *entry = &hub->config.cases[i];
        struct knee_case *knee = NULL;
        enum result result = case_load(entry->dir, &limits, &knee, err);
        if (result == RESULT_OK) {
            result = scene_create(&knee, &hub->scenes[i], err);
            case_destroy(&knee);
        }
        if (result != RESULT_OK)
            return fail_in(err, result, "case %s: ", entry->name);
        log_info("hub", "case %s from %s", entry->name, entry->dir);
        hashes[i] = scene_case(hub->scenes[i])->hash;
    }
    hub->grades = grades_create(&hub->config, hashes);
    return RESULT_OK;
}

static enum result place_seats(struct hub *hub, struct error *err) {
    for (int i = 0; i < hub->config.station_count; i++) {
        const struct hub_station *station = &hub->config.stations[i];
        hub->seats[i].station = station;
        hub->seats[i].tallies = newest_create(sizeof(struct tally));
        hub->seats[i].moment_news = newest_create(sizeof(struct moment));
        atomic_init(&hub->seats[i].counts.state, SESSION_CLOSED);
        hub->seats[i].card.scene = hub_find_case(&hub->config, station->case_name);
        hub->seats[i].card.strength = NAN;
        memcpy(hub->seats[i].card.trainee, station->trainee, sizeof station->trainee);
        if (hub->seats[i].card.scene < 0)
            return fail(err, RESULT_INVALID, "station %s: there is no case %s", station->name,
                        station->case_name);
    }
    return RESULT_OK;
}

static enum result make_traces_dir(const struct hub *hub, struct error *err) {
    const char *dir = hub->config.traces_dir;
    if (mkdir(dir, 0700) && errno != EEXIST)
        return fail(err, RESULT_IO, "%s: %s", dir, strerror(errno));
    if (access(dir, W_OK | X_OK))
        return fail(err, RESULT_IO, "%s: %s", dir, strerror(errno));
    return RESULT_OK;
}

static enum result load_signer(struct hub *hub, struct error *err) {
    enum result result = signer_create(hub->config.keys_dir, &hub->signer, err);
    if (result != RESULT_OK)
        return result;
    hub->vouches.sign = signer_sign;
    hub->vouches.context = hub->signer;
    return RESULT_OK;
}

// For the recorder: scenes stay as they are until it has stopped.
static const struct scene *find_scene(void *user, uint64_t case_hash) {
    const struct hub *hub = user;
    for (int i = 0; i < hub->config.case_count; i++)
        if (scene_case(hub->scenes[i])->hash == case_hash)
            return hub->scenes[i];
    return NULL;
}

int hub_worker_count(const struct hub_config *config) {
    return config->workers ? config->workers : (int)sysconf(_SC_NPROCESSORS_ONLN);
}

static enum result start_workers(struct hub *hub, struct error *err) {
    int wanted = hub_worker_count(&hub->config);
    hub->workers = alloc((unsigned long)wanted, sizeof *hub->workers);
    hub->worker_count = wanted;
    for (int i = 0; i < wanted; i++) {
        enum result result = worker_start(hub, i, err);
        if (result != RESULT_OK)
            return result;
    }
    return RESULT_OK;
}

static enum result open_doors(struct hub *hub, struct error *err) {
    const struct hub_config *config = &hub->config;
    struct control_config control = {
        .address = config->address[0] ? config->address : NULL,
        .port = config->port,
        .authority_dir = config->keys_dir,
        .software = "arthron-server " ARTHRON_VERSION,
        .hello_timeout_ns = 5 * NS_PER_S,
    };
    struct control_handler handler = door_handler(hub);
    enum result result = control_create(&control, &handler, &hub->control, err);
    if (result != RESULT_OK)
        return result;
    struct console_handler console = {hub, desk_command, desk_metrics};
    return console_create(config->socket, &console, &hub->console, err);
}

// The traces that go on are locked before the recorder looks for those that do not.
static void begin(struct hub *hub) {
    char authority[HUB_PATH_MAX + 16];
    snprintf(authority, sizeof authority, "%s/authority.pem", hub->config.keys_dir);
    const struct recorder_config recorder = {
        .records = hub->config.records,
        .traces_dir = hub->config.traces_dir,
        .authority = authority,
        .find = find_scene,
        .user = hub,
    };
    resume_attach(hub);
    if (hub->config.records[0])
        hub->recorder = recorder_start(&recorder);
    resume_record(hub);
    desk_start(hub);
}

enum result hub_create(const struct hub_config *config, struct hub **out_hub, struct error *err) {
    struct hub *hub = alloc(1, sizeof *hub);
    hub->config = *config;
    pthread_mutex_init(&hub->card_lock, NULL);
    pthread_mutex_init(&hub->desk_lock, NULL);
    pthread_rwlock_init(&hub->bell_lock, NULL);
    pthread_cond_init(&hub->clerk_wake, NULL);
    enum result result = make_traces_dir(hub, err);
    if (result == RESULT_OK)
        result = claim_create(config->records, config->traces_dir, &hub->claim, err);
    if (result == RESULT_OK)
        result = load_signer(hub, err);
    if (result == RESULT_OK)
        result = load_scenes(hub, err);
    if (result == RESULT_OK)
        result = place_seats(hub, err);
    if (result == RESULT_OK)
        result = start_workers(hub, err);
    if (result == RESULT_OK) {
        copied_clear(hub->config.traces_dir);
        resume_replay(hub);
        pthread_mutex_lock(&hub->desk_lock); // no command ends them before they have begun
        result = open_doors(hub, err);
        if (result == RESULT_OK)
            begin(hub);
        pthread_mutex_unlock(&hub->desk_lock);
    }
    if (result != RESULT_OK)
        hub_destroy(&hub);
    *out_hub = hub;
    return result;
}

static void release(struct hub *hub) {
    for (int i = 0; i < hub->worker_count; i++)
        worker_release(&hub->workers[i]);
    for (int i = 0; i < hub->config.case_count; i++)
        scene_destroy(&hub->scenes[i]);
    for (int i = 0; i < hub->config.station_count; i++) {
        newest_destroy(&hub->seats[i].moment_news);
        newest_destroy(&hub->seats[i].tallies);
        remarks_fini(&hub->seats[i].remarks);
    }
    pthread_mutex_destroy(&hub->card_lock);
    pthread_mutex_destroy(&hub->desk_lock);
    pthread_rwlock_destroy(&hub->bell_lock);
    pthread_cond_destroy(&hub->clerk_wake);
    resume_release(hub);
    grades_destroy(&hub->grades);
    signer_destroy(&hub->signer);
    claim_destroy(&hub->claim);
    free(hub->workers);
    free(hub);
}

void hub_break_off(struct hub *hub) {
    atomic_store(&hub->ending, true);
}

// Console and clerk first, so that no session begins; then the workers, who end theirs and tell the
// stations; then the control connections; then what the workers left for the desk, and the desk for
// the recorder.
void hub_destroy(struct hub **hub) {
    struct hub *h = *hub;
    hub_break_off(h);
    if (h->console)
        console_destroy(&h->console);
    desk_stop(h);
    for (int i = 0; i < h->worker_count; i++)
        worker_stop(&h->workers[i]);
    if (h->control)
        control_destroy(&h->control);
    desk_release(h);
    recorder_stop(&h->recorder);
    release(h);
    *hub = NULL;
}
