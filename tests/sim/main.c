// The simulation: stations, network, disk and clocks of a hall in one process, by a seed and in
// virtual time. See docs/CONTRIBUTING.md.
#include "base/check.h"
#include "base/clock.h"
#include "case/case.h"
#include "folder.h"
#include "sim/disk.h"
#include "sim/faults.h"
#include "sim/hall.h"
#include "sim/report.h"
#include "sim/station.h"
#include "sim/streams.h"
#include "sim/watch.h"
#include "unit/case_knee.h"

#include <inttypes.h>
#include <malloc.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#define FAULTS_NS (90 * NS_PER_S)
#define RECOVERY_NS (25 * NS_PER_S) // of silence 5 s, back-off 4 s, a name in use 5 s, a start
#define QUIET_NS (4 * NS_PER_S)
#define MEMORY_BYTES ((size_t)256 << 10)

int __real_clock_gettime(clockid_t id, struct timespec *out);

struct totals {
    uint64_t runs, faults[FAULT_COUNT];
    double seconds;
    struct watch_counts watch;
    struct net_counts net;
    struct disk_counts disk;
    struct hall_counts hall;
    size_t memory; // in use after the second run
};

static double real_seconds(clockid_t clock) {
    struct timespec now;
    __real_clock_gettime(clock, &now);
    return (double)now.tv_sec + (double)now.tv_nsec * 1e-9;
}

// ---- one run ------------------------------------------------------------------------------------

static char dir[FOLDER_MAX];

static void make_folder(void) {
    char path[FOLDER_MAX + 32];
    struct knee_case *knee = box_knee();
    folder_make_in_memory(dir);
    snprintf(path, sizeof path, "%s/case", dir);
    CHECK(case_save(knee, path, NULL) == RESULT_OK);
    case_destroy(&knee);
    snprintf(path, sizeof path, "%s/keys", dir);
    CHECK(!mkdir(path, 0700));
    write_file(path, "authority.pem", "", 0);
}

static void remove_folder(void) {
    folder_remove(dir);
}

static void remove_records(void) {
    static const char *const ends[] = {"", "-wal", "-shm", "-server", "-audit"};
    char path[FOLDER_MAX + 32];
    for (size_t i = 0; i < sizeof ends / sizeof *ends; i++) {
        snprintf(path, sizeof path, "%s/records.db%s", dir, ends[i]);
        unlink(path);
    }
}

static void begin(uint64_t seed, int stations, char traces[FOLDER_MAX + 16]) {
    struct random random = {seed};
    snprintf(traces, FOLDER_MAX + 16, "%s/traces", dir);
    folder_remove(traces);
    CHECK(!mkdir(traces, 0700));
    remove_records();
    threads_begin(random_bits(&random));
    streams_begin();
    net_begin(random_bits(&random));
    disk_begin_run(random_bits(&random), traces);
    watch_begin(stations);
    hall_begin(random_bits(&random), dir, stations);
    stations_begin(random_bits(&random), stations);
    faults_begin(random_bits(&random), stations);
}

static void settle(int stations) {
    struct watch_settled before[SIM_STATIONS_MAX];
    for (int i = 0; i < stations; i++)
        before[i] = watch_settled(i, station_link(i), hall_sessions());
    sim_run_until(sim_now_ns() + QUIET_NS);
    for (int i = 0; i < stations; i++) {
        struct watch_settled now = watch_settled(i, station_link(i), hall_sessions());
        uint64_t sent = now.sent - before[i].sent, accepted = now.accepted - before[i].accepted;
        uint64_t refused = now.refused - before[i].refused;
        int64_t open = (int64_t)(sent - accepted - refused);
        if (open < -2 || open > 2)
            broken("frames sent are accepted or counted",
                   "room-%d sent %" PRIu64 ", accepted %" PRIu64 ", counted %" PRIu64, i + 1, sent,
                   accepted, refused);
        int64_t passed_ns = now.time_ns - before[i].time_ns;
        if (passed_ns < QUIET_NS * 98 / 100 || passed_ns > QUIET_NS * 102 / 100)
            broken("a session's time goes with the world's", "room-%d's: %.3f s instead of %.3f s",
                   i + 1, (double)passed_ns / 1e9, (double)QUIET_NS / 1e9);
        if (accepted * 100 < sent * 98)
            broken("while all is fair no frame is lost",
                   "room-%d sent %" PRIu64 ", accepted %" PRIu64, i + 1, sent, accepted);
    }
}

static void end_hall(void) {
    hall_end(DEATH_ENDED);
    sim_run_until(sim_now_ns() + 5 * NS_PER_S);
    if (!hall_has_ended())
        broken("the server ends when it is asked to", "it does not");
}

// A last start closes the traces that no session goes on with.
static void end(int stations) {
    for (int i = 0; i < stations; i++)
        station_stop(i);
    sim_run_until(sim_now_ns() + 2 * NS_PER_S);
    for (int i = 0; i < stations; i++)
        if (!station_has_ended(i))
            broken("a station ends when it is asked to", "room-%d does not", i + 1);
    end_hall();
    hall_start();
    sim_run_until(sim_now_ns() + 2 * NS_PER_S);
    end_hall();
}

static void run_faults(void) {
    int64_t end_ns = sim_now_ns() + FAULTS_NS;
    hall_command_freely(true);
    while (sim_now_ns() < end_ns) {
        faults_step(true);
        sim_run_until(faults_next_ns());
    }
    hall_command_freely(false);
    int64_t fair_ns = sim_now_ns();
    happened("faults are over");
    while (!faults_step(false) || sim_now_ns() < fair_ns + RECOVERY_NS) {
        if (sim_now_ns() > fair_ns + 2 * RECOVERY_NS)
            broken("after the faults every program runs", "one does not");
        sim_run_until(faults_next_ns());
    }
}

static uint64_t run(uint64_t seed, bool verbose, struct totals *totals) {
    char traces[FOLDER_MAX + 16];
    int stations = 1 + (int)(seed % 3);
    report_begin(seed, verbose);
    begin(seed, stations, traces);
    hall_start();
    for (int i = 0; i < stations; i++)
        station_start(i);
    run_faults();
    settle(stations);
    end(stations);
    watch_replay_all(sim_scene());
    threads_end();
    sim_finish_events();
    if (net_open_descriptors() || streams_open())
        broken("programs close what they open", "%d descriptors, %d streams are left",
               net_open_descriptors(), streams_open());
    totals->seconds += (double)(sim_now_ns() - SIM_BEGIN_NS) / NS_PER_S;
    return report_take_hash();
}

// ---- many ---------------------------------------------------------------------------------------

static void add(struct totals *t) {
    struct watch_counts w = watch_counts();
    struct net_counts n = net_counts();
    struct disk_counts d = disk_counts();
    struct hall_counts h = hall_counts();
    t->runs++;
    t->watch.steps += w.steps;
    t->watch.traces += w.traces;
    t->watch.resumes += w.resumes;
    t->watch.replayed += w.replayed;
    t->watch.lost_steps += w.lost_steps;
    t->watch.remarks += w.remarks;
    t->watch.views += w.views;
    if (w.error_mm > t->watch.error_mm)
        t->watch.error_mm = w.error_mm;
    t->net.sent += n.sent;
    t->net.lost += n.lost;
    t->disk.writes += d.writes;
    t->disk.refused_writes += d.refused_writes;
    t->disk.failed_syncs += d.failed_syncs;
    t->disk.pages_lost += d.pages_lost;
    t->hall.starts += h.starts;
    t->hall.commands += h.commands;
    for (int i = 0; i < FAULT_COUNT; i++)
        t->faults[i] += faults_count((enum fault)i);
}

// All that a run had is given back.
static void finish(struct totals *totals) {
    add(totals);
    watch_end();
    disk_end_run();
    net_end();
    size_t used = mallinfo2().uordblks;
    if (totals->runs == 2)
        totals->memory = used;
    if (totals->runs > 2 && used > totals->memory + MEMORY_BYTES)
        broken("memory stays bounded", "%zu KB are in use after %" PRIu64 " runs, %zu KB after two",
               used >> 10, totals->runs, totals->memory >> 10);
}

static void print(const struct totals *t, double took_s, uint64_t hash) {
    printf("%" PRIu64 " runs, %.0f s of virtual time (%.2f h), %.0f times as fast as life, %.0f by "
           "its own processor time\n",
           t->runs, t->seconds, t->seconds / 3600, t->seconds / took_s,
           t->seconds / real_seconds(CLOCK_PROCESS_CPUTIME_ID));
    printf("%" PRIu64 " steps, %" PRIu64 " traces, %" PRIu64 " resumed, %" PRIu64
           " steps replayed, %" PRIu64 " lost in kills; %" PRIu64 " views, largest error %.3f mm\n",
           t->watch.steps, t->watch.traces, t->watch.resumes, t->watch.replayed,
           t->watch.lost_steps, t->watch.views, t->watch.error_mm);
    printf("%" PRIu64 " datagrams, %" PRIu64 " lost; %" PRIu64 " writes, %" PRIu64
           " refused, %" PRIu64 " failed fdatasync, %" PRIu64 " pages lost; %" PRIu64
           " starts of the server, %" PRIu64 " commands, %" PRIu64 " remarks kept\n",
           t->net.sent, t->net.lost, t->disk.writes, t->disk.refused_writes, t->disk.failed_syncs,
           t->disk.pages_lost, t->hall.starts, t->hall.commands, t->watch.remarks);
    for (int i = 0; i < FAULT_COUNT; i++)
        printf("%s%s %" PRIu64, i ? ", " : "faults: ", fault_names[i], t->faults[i]);
    printf("\nhash %016" PRIx64 "\n", hash);
}

struct arguments {
    double seconds; // 0: one run
    uint64_t seed;
    const char *seeds; // a file of those that are run first; NULL: none
    bool verbose;
};

static bool parse(int count, char **words, struct arguments *out) {
    char *rest = NULL;
    *out = (struct arguments){.seed = 1};
    for (int i = 1; i < count; i++) {
        rest = NULL;
        if (!strcmp(words[i], "--verbose"))
            out->verbose = true;
        else if (!strcmp(words[i], "--seed") && i + 1 < count)
            out->seed = strtoull(words[++i], &rest, 10);
        else if (!strcmp(words[i], "--seeds") && i + 1 < count)
            out->seeds = words[++i];
        else
            out->seconds = strtod(words[i], &rest);
        if (rest && *rest)
            return false;
    }
    return count > 1;
}

static uint64_t run_and_finish(uint64_t seed, const struct arguments *arguments,
                               struct totals *totals) {
    uint64_t hash = run(seed, arguments->verbose, totals);
    finish(totals);
    return hash;
}

// The first word of each line, but of remarks (#).
static uint64_t run_listed(const struct arguments *arguments, struct totals *totals) {
    FILE *file = fopen(arguments->seeds, "re");
    char line[256];
    uint64_t all = 0;
    if (!file) {
        perror(arguments->seeds);
        exit(2);
    }
    while (fgets(line, sizeof line, file))
        if (line[0] != '#')
            all = all * 31 + run_and_finish(strtoull(line, NULL, 10), arguments, totals);
    fclose(file);
    return all;
}

int main(int count, char **words) {
    static struct totals totals;
    struct arguments arguments;
    bool asks = count == 2 && !strcmp(words[1], "--help");
    if (asks || !parse(count, words, &arguments)) {
        fputs("Usage: arthron-sim SECONDS [--seed N] [--seeds FILE] [--verbose]\n"
              "Runs simulations for so long, each with the next seed; with a seed alone that one.\n"
              "What does not hold ends it at once, after lines that say what, and with which seed.\n",
              asks ? stdout : stderr);
        return asks ? 0 : 2;
    }
    double begin_s = real_seconds(CLOCK_MONOTONIC), took_s = 0;
    uint64_t seed = arguments.seed;
    make_folder();
    report_at_end(remove_folder);
    uint64_t all = arguments.seeds ? run_listed(&arguments, &totals) : 0;
    do {
        all = all * 31 + run_and_finish(seed++, &arguments, &totals);
        took_s = real_seconds(CLOCK_MONOTONIC) - begin_s;
    } while (took_s < arguments.seconds);
    print(&totals, took_s, all);
    remove_folder();
    return 0;
}
