#include "hall.h"

#include "base/check.h"
#include "base/clock.h"
#include "link/key_files.h"
#include "link/link_parts.h"
#include "net/authority.h"
#include "net/authority_keys.h"
#include "program.h"

#include <dirent.h>
#include <errno.h>
#include <math.h>
#include <openssl/x509.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

#define PATIENCE_NS (60 * NS_PER_S)
#define PATIENCE_EACH_NS (NS_PER_S / 5) // of a station that joins
#define LOOK_NS (10 * NS_PER_MS)
#define TOGETHER 16 // stations that join

static void path_in(const struct hall *hall, const char *name, char *out, size_t size) {
    snprintf(out, size, "%s/%s", hall->folder, name);
}

static void name_station(int station, char out[32]) {
    snprintf(out, 32, "station-%d", station);
}

static void pause_ns(int64_t ns) {
    nanosleep(&(struct timespec){ns / NS_PER_S, ns % NS_PER_S}, NULL);
}

// ---- the server ---------------------------------------------------------------------------------

static enum result write_config(const struct hall *hall, const struct hall_setup *setup,
                                struct error *err) {
    char path[128];
    path_in(hall, "server.ini", path, sizeof path);
    FILE *file = fopen(path, "w");
    if (!file)
        return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    fprintf(file,
            "[server]\naddress = 127.0.0.1\nport = %d\nudp_port = 0\nworkers = %d\nkeys = keys\n"
            "traces = traces\nsocket = s\n[case hall]\ndir = %s\n",
            hall->port, setup->cpu < 0 ? 0 : 1, setup->case_dir);
    for (int i = 0; i < hall->station_count; i++)
        fprintf(file, "[station station-%d]\ncase = hall\n", i);
    if (setup->nats)
        fprintf(file, "[cluster]\nname = bench\nnats = %s\nstations = 127.0.0.1:%d\n", setup->nats,
                hall->port);
    return fclose(file) ? fail(err, RESULT_IO, "%s: %s", path, strerror(errno)) : RESULT_OK;
}

static enum result make_keys(const struct hall *hall, struct error *err) {
    char keys[128];
    const char *host = "127.0.0.1";
    path_in(hall, "keys", keys, sizeof keys);
    return authority_init(keys, &host, 1, err);
}

static enum result start_server(struct hall *hall, const struct hall_setup *setup,
                                struct error *err) {
    char config[128], log[128];
    path_in(hall, "server.ini", config, sizeof config);
    path_in(hall, "server.log", log, sizeof log);
    struct program program = {
        {"arthron-server", "run", "--config", config}, .log = log, .cpu = setup->cpu};
    if (setup->field) {
        program.words[4] = "--bench-field";
        program.words[5] = setup->field;
    }
    enum result result = program_start(&program, &hall->pid, NULL, err);
    return result == RESULT_OK ? program_wait(hall->pid, log, "ready on port", err) : result;
}

// The server inherits them.
static void raise_descriptors(void) {
    struct rlimit limit;
    if (getrlimit(RLIMIT_NOFILE, &limit))
        return;
    limit.rlim_cur = limit.rlim_max;
    setrlimit(RLIMIT_NOFILE, &limit);
}

// ---- its threads --------------------------------------------------------------------------------

static bool is_called(pid_t pid, const char *thread, const char *name) {
    char path[320], comm[32] = "";
    snprintf(path, sizeof path, "/proc/%d/task/%s/comm", pid, thread);
    FILE *file = fopen(path, "r");
    bool called = file && fgets(comm, sizeof comm, file) && !strncmp(comm, name, strlen(name));
    if (file)
        fclose(file);
    return called;
}

static pid_t find_thread(pid_t pid, const char *name) {
    char path[64];
    snprintf(path, sizeof path, "/proc/%d/task", pid);
    DIR *threads = opendir(path);
    pid_t found = 0;
    for (struct dirent *thread; threads && !found && (thread = readdir(threads));)
        if (is_called(pid, thread->d_name, name))
            found = atoi(thread->d_name);
    if (threads)
        closedir(threads);
    return found;
}

static int64_t thread_ns(pid_t pid, const char *thread) {
    char path[320];
    long long ns = 0;
    snprintf(path, sizeof path, "/proc/%d/task/%s/schedstat", pid, thread);
    FILE *file = fopen(path, "r");
    if (file && fscanf(file, "%lld", &ns) != 1)
        ns = 0;
    if (file)
        fclose(file);
    return ns;
}

int64_t hall_worker_ns(const struct hall *hall) {
    char thread[16];
    snprintf(thread, sizeof thread, "%d", hall->worker);
    return thread_ns(hall->pid, thread);
}

int64_t hall_server_ns(const struct hall *hall) {
    clockid_t clock;
    struct timespec time = {0};
    if (!clock_getcpuclockid(hall->pid, &clock))
        clock_gettime(clock, &time);
    return time.tv_sec * NS_PER_S + time.tv_nsec;
}

double hall_memory(const struct hall *hall) {
    char path[64], line[128];
    double kib = NAN;
    snprintf(path, sizeof path, "/proc/%d/smaps_rollup", hall->pid);
    FILE *file = fopen(path, "r");
    while (file && fgets(line, sizeof line, file))
        if (!strncmp(line, "Private_Dirty:", 14))
            kib = atof(line + 14);
    if (file)
        fclose(file);
    return kib * 1024;
}

// ---- stations -----------------------------------------------------------------------------------

// All stations of a hall have one key: so that none has to be made.
static enum result enrol(const struct hall *hall, int station, const struct issuer *authority,
                         struct error *err) {
    char keys[128], name[32];
    name_station(station, name);
    path_in(hall, name, keys, sizeof keys);
    return hall_enrol(keys, name, hall->key, authority, err);
}

enum result hall_enrol(const char *keys, const char *name, EVP_PKEY *key,
                       const struct issuer *authority, struct error *err) {
    X509 *certificate = certificate_make(CERTIFICATE_STATION, name, NULL, key, authority);
    enum result result = key_files_write(keys, key, certificate, authority->certificate, err);
    X509_free(certificate);
    return result;
}

// Not over the network, where one address enrols a station a second, and without its records.
static enum result enrol_all(struct hall *hall, struct error *err) {
    char server_keys[128];
    struct issuer authority;
    path_in(hall, "keys", server_keys, sizeof server_keys);
    enum result result = issuer_read(server_keys, &authority, err);
    if (result != RESULT_OK)
        return result;
    hall->key = certificate_key();
    for (int i = 0; i < hall->station_count && result == RESULT_OK; i++)
        result = enrol(hall, i, &authority, err);
    issuer_release(&authority);
    return result;
}

static enum result join(struct hall *hall, int station, struct error *err) {
    char keys[128], name[32];
    name_station(station, name);
    path_in(hall, name, keys, sizeof keys);
    struct link_config config = {.server_count = 1,
                                 .servers = {{"127.0.0.1", hall->port}},
                                 .keys_dir = keys,
                                 .station = name,
                                 .software = "arthron-bench",
                                 .datagrams = true,
                                 .instruments = *instruments_usual(),
                                 .device_count = 1};
    snprintf(config.devices[0].name, sizeof config.devices[0].name, "bench");
    return link_create(&config, &hall->links[station], err);
}

static void ask(struct link *link, uint64_t *number) {
    struct frame frame = load_frame(*number + 1, clock_now_ns());
    if (link_send(link, &frame))
        ++*number;
}

static bool answers_by_datagram(struct link *link) {
    arthron_Reply reply;
    struct link_status status;
    while (link_wait(link, 0, &reply))
        ;
    link_get_status(link, &status);
    return status.path == LINK_DATAGRAM;
}

static bool has_session(struct link *link) {
    struct link_status status;
    link_get_status(link, &status);
    return status.state == arthron_SessionState_RUNNING;
}

static enum result wait_for_session(const struct hall *hall, int station, int64_t end_ns,
                                    struct error *err) {
    while (!has_session(hall->links[station])) {
        if (clock_now_ns() > end_ns)
            return fail(err, RESULT_CLOSED, "station %d gets no session", station);
        pause_ns(LOOK_NS);
    }
    return RESULT_OK;
}

// Not all at once: their ends of the handshakes take the same processors as the server's.
static enum result join_all(struct hall *hall, int64_t end_ns, struct error *err) {
    enum result result = RESULT_OK;
    for (int i = 0; i < hall->station_count + TOGETHER && result == RESULT_OK; i++) {
        if (i < hall->station_count)
            result = join(hall, i, err);
        if (result == RESULT_OK && i >= TOGETHER)
            result = wait_for_session(hall, i - TOGETHER, end_ns, err);
    }
    return result;
}

// Asks those that get none by datagram; how many those are, from `first` on.
static int ask_again(struct hall *hall, int *first) {
    int left = 0;
    for (int i = hall->caller_count - 1; i >= 0; i--) {
        if (answers_by_datagram(hall->links[i]))
            continue;
        ask(hall->links[i], &hall->callers[i].number);
        *first = i;
        left++;
    }
    return left;
}

static enum result wait_for_replies(struct hall *hall, int64_t end_ns, struct error *err) {
    int station;
    hall->callers = alloc((size_t)hall->caller_count, sizeof *hall->callers);
    while (ask_again(hall, &station) > 0) {
        if (clock_now_ns() > end_ns)
            return fail(err, RESULT_CLOSED, "station %d gets no replies by datagram", station);
        pause_ns(LOOK_NS);
    }
    for (int i = 0; i < hall->caller_count; i++) {
        const struct udp *udp = &hall->links[i]->sender.udp;
        hall->callers[i].fd = udp->fd;
        hall->callers[i].to_server = udp->present.to_server;
        hall->callers[i].to_station = udp->present.to_station;
    }
    return RESULT_OK;
}

static enum result open_stations(struct hall *hall, struct error *err) {
    hall->links = alloc((size_t)hall->station_count, sizeof *hall->links);
    enum result result = enrol_all(hall, err);
    int64_t end_ns = clock_now_ns() + PATIENCE_NS + hall->station_count * PATIENCE_EACH_NS;
    if (result == RESULT_OK)
        result = join_all(hall, end_ns, err);
    return result == RESULT_OK ? wait_for_replies(hall, end_ns, err) : result;
}

enum result hall_start(const struct hall_setup *setup, struct hall *hall, struct error *err) {
    *hall = (struct hall){.station_count = setup->station_count + setup->idle,
                          .caller_count = setup->station_count,
                          .port = program_port()};
    raise_descriptors();
    folder_make(hall->folder);
    enum result result = write_config(hall, setup, err);
    if (result == RESULT_OK)
        result = make_keys(hall, err);
    if (result == RESULT_OK)
        result = start_server(hall, setup, err);
    if (result == RESULT_OK)
        result = open_stations(hall, err);
    hall->worker = find_thread(hall->pid, "worker");
    if (result != RESULT_OK)
        hall_end(hall);
    return result;
}

void hall_end(struct hall *hall) {
    for (int i = 0; hall->links && i < hall->station_count; i++)
        if (hall->links[i])
            link_destroy(&hall->links[i]);
    EVP_PKEY_free(hall->key);
    free(hall->links);
    free(hall->callers);
    program_end(&hall->pid, SIGTERM);
    folder_remove(hall->folder);
}
