// arthron-bench cluster: two real servers, three NATS nodes, and a station whose hands cut. One
// server is killed or drained, and the other goes on.
#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "bench.h"
#include "generate/generate.h"
#include "hall.h"
#include "link/link.h"
#include "net/authority.h"
#include "net/authority_keys.h"
#include "net/console.h"
#include "nodes.h"
#include "program.h"
#include "random.h"
#include "samples.h"
#include "step/scene.h"

#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define SERVERS 2
#define RATE_NS (10 * NS_PER_MS)
#define CUT_NS (2 * NS_PER_S)
#define REST_NS NS_PER_S
#define PATIENCE_NS (60 * NS_PER_S)
#define PAIRS 5
#define STATIONS 20
#define STATION_HZ 100

struct place {
    struct nodes nodes;
    char folder[FOLDER_MAX], case_dir[FOLDER_MAX + 16];
    pid_t pids[SERVERS];
    int ports[SERVERS], starts[SERVERS];
    struct link *link;
    struct knee_case *knee;
    struct random random;
    vec3 tip, target;
    double opening, closing;
    uint64_t number;
    int64_t replied_ns, gap_ns; // the longest between replies
};

struct found {
    struct samples failover_s, lease_s, replay_s, reconnect_s, move_s, move_replay_s;
    double lost, differences, double_owners, cuts;
    double journal_bytes, journal_s;
};

static const char *const names[SERVERS] = {"a", "b"};

// ---- files --------------------------------------------------------------------------------------

// name: the beginning of the file's name; `end`: behind the number.
static void path_in(const struct place *p, const char *name, int number, const char *end,
                    char out[160]) {
    snprintf(out, 160, "%.80s/%s-%d%s", p->folder, name, number, end);
}

static enum result write_config(const struct place *p, int server, struct error *err) {
    char path[160];
    path_in(p, "server", server, ".ini", path);
    FILE *file = fopen(path, "w");
    if (!file)
        return fail(err, RESULT_IO, "%s cannot be made", path);
    fprintf(
        file,
        "[server]\naddress = 127.0.0.1\nport = %d\nudp_port = 0\nworkers = 1\nkeys = keys\n"
        "traces = traces-%d\nsocket = s-%d\n[case hall]\ndir = %s\n[station bench]\ncase = hall\n"
        "[cluster]\nname = %s\nnats = %s\nstations = 127.0.0.1:%d\n",
        p->ports[server], server, server, p->case_dir, names[server], p->nodes.addresses,
        p->ports[server]);
    return fclose(file) ? fail(err, RESULT_IO, "%s cannot be written", path) : RESULT_OK;
}

static enum result start_server(struct place *p, int server, struct error *err) {
    char config[160], log[160];
    path_in(p, "server", server, ".ini", config);
    path_in(p, names[server], p->starts[server]++, ".log", log);
    struct program program = {{"arthron-server", "run", "--config", config}, .log = log, .cpu = -1};
    enum result result = program_start(&program, &p->pids[server], NULL, err);
    return result == RESULT_OK ? program_wait(p->pids[server], log, "ready on port", err) : result;
}

static enum result make_case(struct place *p, struct error *err) {
    struct recipe recipe;
    enum result result = recipe_load(CASES "/healthy", &recipe, err);
    if (result == RESULT_OK)
        result = generate_knee(&recipe, &p->knee, err);
    return result == RESULT_OK ? case_save(p->knee, p->case_dir, err) : result;
}

static enum result make_keys(const struct place *p, struct error *err) {
    char keys[160], station[160];
    const char *host = "127.0.0.1";
    struct issuer authority;
    snprintf(keys, sizeof keys, "%.80s/keys", p->folder);
    snprintf(station, sizeof station, "%.80s/bench", p->folder);
    enum result result = authority_init(keys, &host, 1, err);
    if (result == RESULT_OK)
        result = issuer_read(keys, &authority, err);
    if (result != RESULT_OK)
        return result;
    EVP_PKEY *key = certificate_key();
    result = hall_enrol(station, "bench", key, &authority, err);
    EVP_PKEY_free(key);
    issuer_release(&authority);
    return result;
}

static enum result join(struct place *p, struct error *err) {
    char keys[160];
    snprintf(keys, sizeof keys, "%.80s/bench", p->folder);
    struct link_config config = {
        .server_count = SERVERS,
        .servers = {{"127.0.0.1", p->ports[0]}, {"127.0.0.1", p->ports[1]}},
        .keys_dir = keys,
        .station = "bench",
        .software = "arthron-bench",
        .datagrams = true,
        .instruments = *instruments_usual(),
        .device_count = 1};
    snprintf(config.devices[0].name, sizeof config.devices[0].name, "bench");
    return link_create(&config, &p->link, err);
}

// ---- hands --------------------------------------------------------------------------------------

static vec3 on_meniscus(struct place *p) {
    for (int g = 0; g < p->knee->group_count; g++)
        if (!strcmp(p->knee->groups[g].name, "meniscus_medial")) {
            const struct mesh *mesh = &p->knee->groups[g].mesh;
            return mesh_vertex(mesh, (uint32_t)(random_bits(&p->random) % mesh->vertex_count));
        }
    return (vec3){0};
}

static void move_hand(struct place *p) {
    vec3 way = vec3_sub(p->target, p->tip);
    double length = vec3_length(way);
    if (length < 0.5)
        p->target = on_meniscus(p);
    p->tip = vec3_add_scaled(p->tip, length > 0.6 ? 0.6 / length : 1, way);
    p->opening += p->closing;
    if (p->opening < 0 || p->opening > 1)
        p->closing = -p->closing;
    p->opening = p->opening < 0 ? 0 : p->opening > 1 ? 1 : p->opening;
}

static void add(struct frame *frame, struct sample sample) {
    sample.time_ns = frame->time_ns;
    frame->samples[frame->count++] = sample;
}

static struct frame next_frame(struct place *p, bool cuts) {
    struct frame frame = {.number = p->number + 1, .time_ns = clock_now_ns()};
    if (cuts)
        move_hand(p);
    pose T = {quat_from_axis_angle((vec3){1, 0, 0}, 1.4), p->tip};
    add(&frame, (struct sample){
                    .channel = CHANNEL_JOINT, .kind = SAMPLE_JOINT, .joint = {.flexion_deg = 30}});
    add(&frame, (struct sample){.channel = CHANNEL_PUNCH, .kind = SAMPLE_POSE, .T_mockup_body = T});
    add(&frame, (struct sample){
                    .channel = CHANNEL_PUNCH, .kind = SAMPLE_HANDLE, .handle = {p->opening, 0}});
    return frame;
}

// One frame, and the replies until the next.
static void beat(struct place *p, bool cuts) {
    struct frame frame = next_frame(p, cuts);
    int64_t until_ns = frame.time_ns + RATE_NS;
    arthron_Reply reply;
    if (link_send(p->link, &frame))
        p->number++;
    while (link_wait(p->link, until_ns, &reply)) {
        int64_t now_ns = clock_now_ns(), gap_ns = now_ns - p->replied_ns;
        p->gap_ns = gap_ns > p->gap_ns ? gap_ns : p->gap_ns;
        p->replied_ns = now_ns;
    }
    int64_t left_ns = until_ns - clock_now_ns();
    if (left_ns > 0) // there is no connection to wait on
        nanosleep(&(struct timespec){0, left_ns}, NULL);
}

static void beats(struct place *p, int64_t lasts_ns, bool cuts) {
    for (int64_t end_ns = clock_now_ns() + lasts_ns; clock_now_ns() < end_ns;)
        beat(p, cuts);
}

// ---- what a server says -------------------------------------------------------------------------

// False: it has no session.
static bool ask(const struct place *p, int server, arthron_CommandReply *out) {
    char socket[160];
    struct error err;
    arthron_Command command = {.kind = arthron_Command_Kind_SHOW, .station = "bench"};
    path_in(p, "s", server, "", socket);
    return console_call(socket, &command, out, &err) == RESULT_OK && out->ok &&
           out->sessions[0].state != arthron_SessionState_CLOSED;
}

static int owner(const struct place *p, arthron_CommandReply *out) {
    for (int i = 0; i < SERVERS; i++)
        if (p->pids[i] && ask(p, i, out) && out->sessions[0].connected)
            return i;
    return -1;
}

static enum result wait_for_owner(struct place *p, arthron_CommandReply *out, int *out_owner,
                                  struct error *err) {
    int64_t end_ns = clock_now_ns() + PATIENCE_NS;
    while ((*out_owner = owner(p, out)) < 0 || out->sessions[0].unprotected) {
        beats(p, RATE_NS, false);
        if (clock_now_ns() > end_ns)
            return fail(err, RESULT_TIMEOUT,
                        "no server has the session and protects it in a minute");
    }
    return RESULT_OK;
}

static bool is_equal(const arthron_CommandReply *a, const arthron_CommandReply *b) {
    bool equal = a->resections_count == b->resections_count;
    for (pb_size_t i = 0; equal && i < a->resections_count; i++) {
        const arthron_Resection *one = &a->resections[i], *other = &b->resections[i];
        equal = one->mesh_hash == other->mesh_hash && one->mesh_number == other->mesh_number &&
                one->cuts == other->cuts && one->removed_mm3 == other->removed_mm3;
    }
    return equal;
}

// The session once no cut is on its way any more. other: room for another answer.
static enum result wait_for_rest(struct place *p, arthron_CommandReply *out,
                                 arthron_CommandReply *other, int *out_owner, struct error *err) {
    enum result result;
    do {
        result = wait_for_owner(p, out, out_owner, err);
        beats(p, REST_NS, false);
        if (result == RESULT_OK)
            result = wait_for_owner(p, other, out_owner, err);
    } while (result == RESULT_OK && !is_equal(out, other));
    return result;
}

// When a line with the text was written; NaN: there is none.
static double said_at(const char *log, const char *text, double *out_ms) {
    char line[1024];
    double at = NAN;
    FILE *file = fopen(log, "r");
    while (file && fgets(line, sizeof line, file)) {
        struct tm day = {0};
        double seconds;
        const char *after = strstr(line, " after ");
        if (!strstr(line, text) || sscanf(line, "%d-%d-%dT%d:%d:%lf", &day.tm_year, &day.tm_mon,
                                          &day.tm_mday, &day.tm_hour, &day.tm_min, &seconds) != 6)
            continue;
        day.tm_year -= 1900;
        day.tm_mon--;
        at = (double)timegm(&day) + seconds;
        if (out_ms && after)
            *out_ms = atof(after + 7);
    }
    if (file)
        fclose(file);
    return at;
}

// ---- a round ------------------------------------------------------------------------------------

static void note_parts(const struct place *p, int next, bool killed, double begun_s, double gap_s,
                       struct found *found) {
    char log[160];
    double replay_ms = NAN;
    path_in(p, names[next], p->starts[next] - 1, ".log", log);
    double taken_s = said_at(log, "goes on here after", &replay_ms);
    double replay_s = replay_ms / 1000, lease_s = taken_s - begun_s - replay_s;
    samples_add(killed ? &found->failover_s : &found->move_s, gap_s);
    if (!killed) {
        samples_add(&found->move_replay_s, replay_s);
        return;
    }
    samples_add(&found->lease_s, lease_s);
    samples_add(&found->replay_s, replay_s);
    samples_add(&found->reconnect_s, gap_s - lease_s - replay_s);
}

static void judge(const struct place *p, const arthron_CommandReply *before,
                  const arthron_CommandReply *after, struct found *found) {
    arthron_CommandReply *both = alloc(SERVERS, sizeof *both);
    int owners = 0;
    for (int i = 0; i < SERVERS; i++)
        owners += p->pids[i] && ask(p, i, &both[i]);
    found->double_owners += owners > 1;
    found->lost += memcmp(before->sessions[0].id, after->sessions[0].id, 16) != 0;
    found->differences += !is_equal(before, after);
    for (pb_size_t i = 0; i < after->resections_count; i++)
        found->cuts = fmax(found->cuts, after->resections[i].cuts);
    free(both);
}

static enum result round_of(struct place *p, bool kills, struct found *found, struct error *err) {
    arthron_CommandReply *before = alloc(2, sizeof *before), *after = before + 1;
    int was, is;
    double bytes = nodes_bytes(&p->nodes);
    int64_t begin_ns = clock_now_ns();
    beats(p, CUT_NS, true);
    beats(p, REST_NS, false);
    found->journal_bytes += nodes_bytes(&p->nodes) - bytes;
    found->journal_s += (double)(clock_now_ns() - begin_ns) / NS_PER_S;
    enum result result = wait_for_rest(p, before, after, &was, err);
    if (result == RESULT_OK) {
        struct timespec now;
        clock_gettime(CLOCK_REALTIME, &now);
        double begun_s = (double)now.tv_sec + (double)now.tv_nsec / 1e9;
        kill(p->pids[was], kills ? SIGKILL : SIGUSR1);
        p->gap_ns = 0;
        int64_t end_ns = clock_now_ns() + PATIENCE_NS;
        do
            beats(p, NS_PER_S / 5, false);
        while (((is = owner(p, after)) < 0 || is == was) && clock_now_ns() < end_ns);
        beats(p, NS_PER_S / 5, false);
        program_end(&p->pids[was], kills ? SIGKILL : SIGUSR1);
        result = wait_for_owner(p, after, &is, err);
        if (result == RESULT_OK) {
            note_parts(p, is, kills, begun_s, (double)p->gap_ns / NS_PER_S, found);
            judge(p, before, after, found);
            result = start_server(p, was, err);
        }
    }
    free(before);
    return result;
}

static enum result rounds(struct place *p, int kills, int drains, struct found *found,
                          struct error *err) {
    enum result result = RESULT_OK;
    for (int i = 0; i < kills && result == RESULT_OK; i++)
        result = round_of(p, true, found, err);
    for (int i = 0; i < drains && result == RESULT_OK; i++)
        result = round_of(p, false, found, err);
    return result;
}

// ---- the place ----------------------------------------------------------------------------------

static void end(struct place *p) {
    if (p->link)
        link_destroy(&p->link);
    for (int i = 0; i < SERVERS; i++)
        program_end(&p->pids[i], SIGTERM);
    case_destroy(&p->knee);
    folder_remove(p->folder);
}

static enum result begin(struct place *p, struct error *err) {
    folder_make(p->folder);
    snprintf(p->case_dir, sizeof p->case_dir, "%s/case", p->folder);
    p->random = (struct random){1};
    p->opening = 1;
    p->closing = -0.05;
    enum result result = make_case(p, err);
    if (result == RESULT_OK)
        result = make_keys(p, err);
    p->tip = p->target = result == RESULT_OK ? on_meniscus(p) : (vec3){0};
    for (int i = 0; i < SERVERS && result == RESULT_OK; i++) {
        p->ports[i] = program_port();
        result = write_config(p, i, err);
    }
    for (int i = 0; i < SERVERS && result == RESULT_OK; i++)
        result = start_server(p, i, err);
    return result == RESULT_OK ? join(p, err) : result;
}

// ---- poses beside it ----------------------------------------------------------------------------

static enum result p999_of(const struct place *p, const char *nats, int64_t lasts_ns,
                           double *out_us, struct error *err) {
    struct hall hall;
    struct load load = {STATION_HZ, lasts_ns, .sleeps = true};
    struct load_result result = {0};
    struct hall_setup setup = {STATIONS, p->case_dir, NULL, 0, .nats = nats};
    enum result started = hall_start(&setup, &hall, err);
    if (started != RESULT_OK)
        return started;
    load_run(hall.callers, hall.caller_count, &load, &result);
    *out_us = samples_quantile(&result.round_trips_us, 0.999);
    load_result_fini(&result);
    hall_end(&hall);
    return RESULT_OK;
}

static enum result compare_poses(const struct place *p, int pairs, int64_t lasts_ns,
                                 struct report *report, struct error *err) {
    struct samples ratios = {0};
    enum result result = RESULT_OK;
    for (int i = 0; i < pairs && result == RESULT_OK; i++) {
        double single_us, clustered_us;
        result = p999_of(p, NULL, lasts_ns, &single_us, err);
        if (result == RESULT_OK)
            result = p999_of(p, p->nodes.addresses, lasts_ns, &clustered_us, err);
        if (result == RESULT_OK)
            samples_add(&ratios, clustered_us / single_us);
    }
    if (result == RESULT_OK)
        report_mark(report, "pose_p999_clustered_over_single", samples_quantile(&ratios, 0.5), "1",
                    1.1, BETTER_LOW);
    samples_fini(&ratios);
    return result;
}

// ---- all ----------------------------------------------------------------------------------------

static void report_found(struct found *f, struct report *report) {
    report_mark(report, "failover_gap_s_p99", samples_quantile(&f->failover_s, 0.99), "s", 20,
                BETTER_LOW);
    report_mark(report, "planned_move_gap_s_p99", samples_quantile(&f->move_s, 0.99), "s", 1,
                BETTER_LOW);
    report_mark(report, "sessions_lost", f->lost, "sessions", 0, BETTER_LOW);
    report_mark(report, "double_owners", f->double_owners, "rounds", 0, BETTER_LOW);
    report_mark(report, "failover_state_differences", f->differences, "rounds", 0, BETTER_LOW);
    report_figure(report, samples_quantile(&f->failover_s, 0.5), "s", "failover/p50");
    report_figure(report, samples_quantile(&f->lease_s, 0.5), "s", "failover/lease p50");
    report_figure(report, samples_quantile(&f->replay_s, 0.5), "s", "failover/replay p50");
    report_figure(report, samples_quantile(&f->reconnect_s, 0.5), "s", "failover/reconnect p50");
    report_figure(report, samples_quantile(&f->move_s, 0.5), "s", "planned move/p50");
    report_figure(report, samples_quantile(&f->move_replay_s, 0.5), "s", "planned move/replay p50");
    report_figure(report, f->cuts, "cuts", "cuts that were moved");
    report_figure(report, f->journal_bytes / f->journal_s * 3600, "bytes",
                  "journal_bytes_per_station_hour");
}

static void fini(struct found *f) {
    struct samples *all[] = {&f->failover_s,  &f->lease_s, &f->replay_s,
                             &f->reconnect_s, &f->move_s,  &f->move_replay_s};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        samples_fini(all[i]);
}

enum result bench_cluster(const struct bench_options *options, struct report *report,
                          struct error *err) {
    struct place p = {0};
    struct found found = {0};
    bool quick = options->quick;
    log_set_level(LOG_ERROR);
    enum result result = nodes_start(1, &p.nodes, err);
    if (result != RESULT_OK)
        return result;
    result = begin(&p, err);
    if (result == RESULT_OK)
        result = rounds(&p, quick ? 1 : 50, quick ? 3 : 50, &found, err);
    if (result == RESULT_OK) {
        report_found(&found, report);
        result = compare_poses(&p, quick ? 1 : PAIRS, (quick ? 2 : 20) * NS_PER_S, report, err);
    }
    end(&p);
    nodes_end(&p.nodes);
    fini(&found);
    return result;
}
