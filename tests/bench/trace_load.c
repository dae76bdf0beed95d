#include "base/clock.h"
#include "random.h"
#include "trace_parts.h"

#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#define STATIONS 8
#define STEP_NS NS_PER_MS
#define LOAD_S 3

struct load {
    struct trace_writer *writers[STATIONS];
    struct appended *appended; // of each; NULL: nobody asks
    uint64_t step;
};

// When the first and the last step were, 0: none yet.
struct appended {
    atomic_int_fast64_t first_ns, last_ns;
};

static void name_trace(const char *folder, int station, char *out, size_t size) {
    snprintf(out, size, "%s/load-%d.trace", folder, station);
}

static enum result open_load(const char *folder, struct load *load, struct error *err) {
    for (int i = 0; i < STATIONS; i++) {
        char path[128];
        struct trace_header header = {.settings = session_settings_default(),
                                      .optic = view_optic_usual()};
        name_trace(folder, i, path, sizeof path);
        enum result result = trace_writer_create(path, &header, NULL, NULL, &load->writers[i], err);
        if (result != RESULT_OK)
            return result;
    }
    return RESULT_OK;
}

static void remove_load(const char *folder) {
    for (int i = 0; i < STATIONS; i++) {
        char path[128];
        name_trace(folder, i, path, sizeof path);
        unlink(path);
    }
}

// A step with two instruments as a session has them.
static void fill(uint64_t step, int64_t now_ns, struct session_input *input,
                 struct session_output *output) {
    memset(output, 0, sizeof *output);
    *input = (struct session_input){.kind = INPUT_FRAME, .time_ns = now_ns};
    input->frame = (struct frame){.number = step, .time_ns = now_ns, .count = 3};
    input->frame.samples[0].channel = CHANNEL_JOINT;
    for (int i = 0; i < 2; i++) {
        struct sample *sample = &input->frame.samples[1 + i];
        *sample = (struct sample){.channel = (enum channel)(CHANNEL_FIRST_INSTRUMENT + i),
                                  .kind = SAMPLE_POSE,
                                  .time_ns = now_ns,
                                  .T_mockup_body = pose_identity()};
        output->instruments[i].present = true;
        output->instruments[i].extrapolation.mode = AVATAR_RIGID;
    }
    output->step = step;
    output->frame_number = step;
    output->time_ns = now_ns;
}

static void append_all(struct load *load) {
    static struct session_input input;
    static struct session_output output;
    load->step++;
    for (int i = 0; i < STATIONS; i++) {
        fill(load->step, clock_now_ns(), &input, &output);
        trace_append(load->writers[i], &input, &output);
        if (load->appended && load->step == 1)
            atomic_store(&load->appended[i].first_ns, input.time_ns);
        if (load->appended)
            atomic_store(&load->appended[i].last_ns, input.time_ns);
    }
}

static void run_until(struct load *load, int64_t end_ns) {
    for (int64_t next_ns = clock_now_ns(); next_ns < end_ns; next_ns += STEP_NS) {
        struct timespec when = {next_ns / NS_PER_S, next_ns % NS_PER_S};
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &when, NULL);
        append_all(load);
    }
}

static double cpu_seconds(void) {
    struct rusage used;
    getrusage(RUSAGE_SELF, &used);
    return (double)(used.ru_utime.tv_sec + used.ru_stime.tv_sec) +
           1e-6 * (double)(used.ru_utime.tv_usec + used.ru_stime.tv_usec);
}

static enum result measure_load(const char *folder, struct report *report, struct error *err) {
    struct load load = {0};
    enum result result = open_load(folder, &load, err);
    if (result != RESULT_OK)
        return result;
    double before_s = cpu_seconds();
    run_until(&load, clock_now_ns() + LOAD_S * NS_PER_S);
    double used_s = cpu_seconds() - before_s;
    struct trace_status status = trace_writer_status(load.writers[0]);
    report_figure(report, used_s / LOAD_S, "of a core", "load/share");
    report_figure(report, (double)status.bytes / (double)status.records / 2, "bytes",
                  "load/bytes_per_pose");
    report_figure(report, (double)status.missing, "steps", "load/missing");
    for (int i = 0; i < STATIONS; i++)
        trace_writer_destroy(&load.writers[i]);
    remove_load(folder);
    return RESULT_OK;
}

// ---- kill -9 ------------------------------------------------------------------------------------

static void be_killed(const char *folder, struct appended *appended) {
    struct load load = {.appended = appended};
    struct error err;
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (open_load(folder, &load, &err) == RESULT_OK)
        run_until(&load, INT64_MAX);
    _exit(1);
}

static enum result last_recorded(const char *path, int64_t *out_ns, struct error *err) {
    struct trace_reader *reader;
    static struct trace_record record;
    enum result result = trace_reader_create(path, &reader, err);
    if (result != RESULT_OK)
        return result;
    while ((result = trace_read(reader, &record, err)) == RESULT_OK)
        if (record.type == TRACE_STEP)
            *out_ns = record.input.time_ns;
    trace_reader_destroy(&reader);
    return result == RESULT_MISSING ? RESULT_OK : result; // it has no end
}

static void wait_for_steps(const struct appended *appended, int64_t more_ns) {
    while (!atomic_load(&appended[STATIONS - 1].last_ns))
        nanosleep(&(struct timespec){0, NS_PER_MS}, NULL);
    nanosleep(&(struct timespec){0, more_ns}, NULL);
}

static enum result kill_once(const char *folder, struct appended *appended, int64_t after_ns,
                             double *in_out_lost_ms, struct error *err) {
    enum result result = RESULT_OK;
    for (int i = 0; i < STATIONS; i++)
        atomic_store(&appended[i].last_ns, 0);
    pid_t child = fork();
    if (child == 0)
        be_killed(folder, appended);
    wait_for_steps(appended, after_ns);
    kill(child, SIGKILL);
    waitpid(child, NULL, 0);
    for (int i = 0; i < STATIONS && result == RESULT_OK; i++) {
        char path[128];
        int64_t recorded_ns = atomic_load(&appended[i].first_ns); // where none is: all is lost
        name_trace(folder, i, path, sizeof path);
        result = last_recorded(path, &recorded_ns, err);
        double lost_ms = (double)(atomic_load(&appended[i].last_ns) - recorded_ns) / NS_PER_MS;
        *in_out_lost_ms = lost_ms > *in_out_lost_ms ? lost_ms : *in_out_lost_ms;
    }
    remove_load(folder);
    return result;
}

static enum result measure_kills(const char *folder, int times, struct report *report,
                                 struct error *err) {
    struct appended *appended = mmap(NULL, STATIONS * sizeof *appended, PROT_READ | PROT_WRITE,
                                     MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (appended == MAP_FAILED)
        return fail(err, RESULT_IO, "no shared memory");
    struct random random = {1};
    double lost_ms = 0;
    enum result result = RESULT_OK;
    for (int i = 0; i < times && result == RESULT_OK; i++) {
        int64_t after_ns = (int64_t)random_between(&random, 30e6, 130e6);
        result = kill_once(folder, appended, after_ns, &lost_ms, err);
    }
    munmap(appended, STATIONS * sizeof *appended);
    report_figure(report, times, "times", "kill/times");
    if (result == RESULT_OK)
        report_mark(report, "kill_lost_ms_max", lost_ms, "ms", 25, BETTER_LOW);
    return result;
}

enum result bench_trace_load(const char *folder, bool quick, struct report *report,
                             struct error *err) {
    enum result result = measure_load(folder, report, err);
    return result == RESULT_OK ? measure_kills(folder, quick ? 20 : 200, report, err) : result;
}
