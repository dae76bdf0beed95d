#include "base/argument.h"
#include "base/check.h"
#include "base/log.h"
#include "base/service.h"
#include "commands/browsers.h"
#include "commands/commands.h"
#include "commands/known_stations.h"
#include "commands/pinned_cases.h"
#include "commands/read_case.h"
#include "config/config.h"
#include "net/authority.h"
#include "sessions/resources.h"
#include "sessions/sessions.h"
#include "watch/log_journal.h"
#include "watch/log_json.h"

#include <errno.h>
#include <getopt.h>
#include <pthread.h>
#include <semaphore.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#define OVERRIDES_MAX 32
#define MEMORY_KEPT_BACK ((size_t)64 << 20) // more than all that may be under way at once takes

static const char run_help[] =
    "Usage: arthron-server run --config FILE [--set SECTION.KEY=VALUE ...]\n"
    "\n"
    "Serves until SIGTERM or SIGINT, then ends every session and closes its trace.\n"
    "On SIGUSR1 it ends too, but hands its sessions over: the next start goes on with them, or of\n"
    "several servers ([cluster] in the config) the others at once.\n"
    "\n"
    "  -c, --config FILE            the config (docs/CONFIG.md)\n"
    "  -s, --set SECTION.KEY=VALUE  replaces a value of the config: --set server.port=4900,\n"
    "                               --set 'station room-1.case=healthy'\n"
    "      --bench-field NAME       for benches alone: gaussian, inverse-distance or smooth, with "
    "which\n"
    "                               the shown tip jumps\n"
    "      --log json               log objects of JSON, one a line\n"
    "  -v, --verbose                log more\n"
    "      --help                   show this\n";

static const char run_command[] = "arthron-server run";

#define START_PATIENCE_S 3

static atomic_int ended; // the signal that ends the server, or 0
static atomic_bool is_ending, is_ready;
static sem_t end_wanted;

// A start may take minutes, for it runs open sessions again, and ends soon after `ended` is set. A
// start that hangs on a file is broken off as by SIGKILL.
static void *wait_for_end(void *argument) {
    int signal_number;
    sigwait(argument, &signal_number);
    bool ready = atomic_load(&is_ready);
    log_info("server", "%s: ending%s", strsignal(signal_number),
             ready ? "" : " before the server is ready");
    atomic_store(&ended, signal_number);
    atomic_store(&is_ending, true);
    sem_post(&end_wanted);
    sleep(START_PATIENCE_S);
    if (!ready && !atomic_load(&is_ready))
        _exit(0);
    return NULL;
}

static void catch_ends(void) {
    static sigset_t set;
    pthread_t waiting;
    sem_init(&end_wanted, 0, 0);
    sigemptyset(&set);
    sigaddset(&set, SIGTERM);
    sigaddset(&set, SIGINT);
    sigaddset(&set, SIGUSR1);
    pthread_sigmask(SIG_BLOCK, &set, NULL);
    signal(SIGPIPE, SIG_IGN);
    int failed = pthread_create(&waiting, NULL, wait_for_end, &set);
    NEED(!failed, "thread");
    pthread_detach(waiting);
}

static int serve_until_end(const struct server_config *config) {
    struct sessions *sessions;
    struct browsers *browsers = NULL;
    struct error err;
    enum result result = pinned_cases_settle(&config->sessions, &err);
    if (result == RESULT_OK)
        result = sessions_create(&config->sessions, &is_ending, &sessions, &err);
    if (result == RESULT_OK && config->web.port) {
        result = browsers_create(config, sessions, &browsers, &err);
        if (result != RESULT_OK) // the next start goes on with those that were resumed
            sessions_hand_over(&sessions);
    }
    if (result != RESULT_OK && atomic_load(&ended))
        return 0;
    if (result != RESULT_OK) {
        log_error("server", "%s", err.text);
        return 1;
    }
    known_stations_write(&config->sessions);
    atomic_store(&is_ready, true);
    service_notify("READY=1");
    log_info("server", "ready on port %d", config->sessions.port);
    while (sem_wait(&end_wanted) && errno == EINTR)
        ;
    service_notify("STOPPING=1");
    sessions_break_off(sessions);
    browsers_destroy(&browsers);
    if (atomic_load(&ended) == SIGUSR1)
        sessions_hand_over(&sessions);
    else
        sessions_destroy(&sessions);
    return 0;
}

static void reckon(int stations) {
    struct resource_limits limits;
    struct rlimit limit;
    struct error err;
    if (!getrlimit(RLIMIT_NOFILE, &limit)) {
        limit.rlim_cur = limit.rlim_max;
        setrlimit(RLIMIT_NOFILE, &limit);
    }
    resources_look(&limits);
    if (resources_reckon(stations, &limits, &err) != RESULT_OK)
        log_warning("server", "%s", err.text);
}

// A core file would hold keys and cookies, and delay the next start.
static void leave_no_core(void) {
    setrlimit(RLIMIT_CORE, &(struct rlimit){0, 0});
}

static void write_statement(void *xapi, struct store *store, const char *session, int number) {
    xapi_attempt_told(xapi, store, session, number);
}

static int serve_with_statements(struct server_config *config) {
    struct xapi *xapi;
    struct error err;
    if (xapi_start(&config->xapi, &xapi, &err) != RESULT_OK) {
        log_error("server", "[xapi] %s", err.text);
        return 1;
    }
    config->sessions.attempt_written = xapi ? write_statement : NULL;
    config->sessions.attempt_user = xapi;
    int status = serve_until_end(config);
    xapi_stop(&xapi);
    return status;
}

struct run_request {
    const char *path;
    struct setting_override overrides[OVERRIDES_MAX];
    int override_count;
    enum field_kind field;
};

// Before a station asks for a certificate: what is wrong with the key is told at the start.
static enum result look_at_key(const struct sessions_config *config, struct error *err) {
    const struct authority_key_place place = {config->authority_key_dir,
                                              config->authority_passphrase};
    bool encrypted;
    authority_place_key(&place);
    enum result result = authority_check_key(config->keys_dir, &encrypted, err);
    if (result == RESULT_MISSING) {
        log_warning("server", "%s: so no station can be enrolled, and none renews its certificate",
                    err->text);
        return RESULT_OK;
    }
    if (result == RESULT_OK && !encrypted)
        log_warning("server", "authority.key is not encrypted: see arthron-server keys --help");
    return result;
}

static int serve(const struct run_request *request) {
    static struct server_config config;
    struct error err;
    if (config_load(request->path, request->overrides, request->override_count, &config, &err) !=
        RESULT_OK) {
        log_error("server", "%s", err.text);
        return 2;
    }
    if (look_at_key(&config.sessions, &err) != RESULT_OK) {
        log_error("server", "%s", err.text);
        return 1;
    }
    read_case_limit(config.sessions.case_memory_mb);
    config.sessions.check_case = read_case_check;
    struct field *field = &config.sessions.settings.field;
    if (request->field != field->kind)
        log_warning("server", "the field of sessions is %s, for a bench",
                    field_name(request->field));
    field->kind = request->field;
    leave_no_core();
    reckon(config.sessions.station_count);
    catch_ends();
    memory_keep_back(MEMORY_KEPT_BACK);
    log_limit_lines();
    return serve_with_statements(&config);
}

static int take_run_option(int option, struct run_request *out) {
    static const char *const fields[] = {"gaussian", "inverse-distance", "smooth", NULL};
    static const char *const logs[] = {"json", NULL};
    switch (option) {
    case 'c':
        out->path = optarg;
        return 0;
    case 'v':
        log_set_level(LOG_DEBUG);
        return 0;
    case 'l':
        if (strcmp(optarg, logs[0]) != 0)
            return argument_unknown(run_command, "--log", optarg, logs);
        log_as_json();
        return 0;
    case 'b':
        if (!field_from_name(optarg, &out->field) || out->field == FIELD_INTEGRAL)
            return argument_unknown(run_command, "--bench-field", optarg, fields);
        return 0;
    case 's':
        if (out->override_count == OVERRIDES_MAX)
            return argument_wrong(run_command, "--set can be given %d times at most",
                                  OVERRIDES_MAX);
        if (!setting_split(optarg, &out->overrides[out->override_count++]))
            return argument_wrong(run_command, "--set %s is not SECTION.KEY=VALUE", optarg);
        return 0;
    default:
        return argument_help(run_command);
    }
}

int command_run(int argc, char **argv) {
    static const struct option options[] = {
        {"config", required_argument, NULL, 'c'},
        {"set", required_argument, NULL, 's'},
        {"bench-field", required_argument, NULL, 'b'},
        {"log", required_argument, NULL, 'l'},
        {"verbose", no_argument, NULL, 'v'},
        {"help", no_argument, NULL, 'h'},
        {0},
    };
    struct run_request request = {.field = FIELD_INTEGRAL};
    log_to_journal();
    for (int o; (o = getopt_long(argc, argv, "c:s:v", options, NULL)) != -1;) {
        if (o == 'h') {
            fputs(run_help, stdout);
            return 0;
        }
        int wrong = take_run_option(o, &request);
        if (wrong)
            return wrong;
    }
    if (!request.path)
        return argument_wrong(run_command, "--config FILE is missing");
    if (optind != argc)
        return argument_wrong(run_command, "unexpected argument %s", argv[optind]);
    return serve(&request);
}
