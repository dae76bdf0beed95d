#include "random.h"
#include "trace/rerun.h"
#include "trace_parts.h"

#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

// ---- other programs -----------------------------------------------------------------------------

static enum result read_all(const char *line, char *out, size_t size, struct error *err) {
    FILE *program = popen(line, "r");
    if (!program)
        return fail(err, RESULT_IO, "%s: cannot be started", line);
    size_t used = fread(out, 1, size - 1, program);
    out[used] = '\0';
    pclose(program);
    return RESULT_OK;
}

enum result bench_trace_unoptimized(const char *path, const char *case_dir, double *out_differences,
                                    struct error *err) {
    char line[512], text[512];
    int different, steps;
    snprintf(line, sizeof line, "%s %s %s 2>&1", UNOPTIMIZED, path, case_dir);
    enum result result = read_all(line, text, sizeof text, err);
    if (result != RESULT_OK)
        return result;
    if (sscanf(text, "%*[a-z], %d of %d steps differ", &different, &steps) != 2 || !steps)
        return fail(err, RESULT_FORMAT, "%s: %s", line, text);
    *out_differences = different;
    return RESULT_OK;
}

enum result bench_trace_other_cpu(const char *path, const char *case_dir, double *out_mm,
                                  struct error *err) {
    char line[768], text[4096];
    snprintf(line, sizeof line,
             "GLIBC_TUNABLES=glibc.cpu.hwcaps=-AVX2_Usable,-FMA_Usable,-AVX2,-FMA,-FMA4 "
             "%s replay %s --case %s --json 2>/dev/null",
             TRACE_PROGRAM, path, case_dir);
    enum result result = read_all(line, text, sizeof text, err);
    if (result != RESULT_OK)
        return result;
    json_t *root = json_loads(text, 0, NULL);
    if (!root)
        return fail(err, RESULT_FORMAT, "%s: %.200s", line, text);
    json_t *mm = json_object_get(root, "largest_mm");
    bool same = json_is_true(json_object_get(root, "same_events")) && json_is_real(mm);
    *out_mm = same ? json_real_value(mm) : INFINITY;
    json_decref(root);
    return RESULT_OK;
}

// ---- resuming -----------------------------------------------------------------------------------

static enum result copy_head(const char *path, const char *to, uint64_t bytes, struct error *err) {
    FILE *in = fopen(path, "rb"), *out = fopen(to, "wb");
    char block[1 << 16];
    while (in && out && bytes) {
        size_t got = fread(block, 1, bytes < sizeof block ? bytes : sizeof block, in);
        if (!got)
            break;
        fwrite(block, 1, got, out);
        bytes -= got;
    }
    bool good = in && out && !bytes;
    if (in)
        fclose(in);
    if (out)
        good = fclose(out) == 0 && good;
    return good ? RESULT_OK : fail(err, RESULT_IO, "%s: cannot be copied", path);
}

// Steps from `from` on.
static enum result rerun_rest(const char *path, struct rerun *rerun, uint64_t from,
                              double *in_out_differences, uint64_t *out_step, struct error *err) {
    struct trace_reader *reader;
    static struct trace_record record;
    static struct session_output output;
    enum result result = trace_reader_create(path, &reader, err);
    if (result != RESULT_OK)
        return result;
    while ((result = trace_read(reader, &record, err)) == RESULT_OK) {
        if (record.type != TRACE_STEP || record.output.step < from)
            continue;
        rerun_step(rerun, &record, &output);
        *in_out_differences += output.hash != record.output.hash;
        *out_step = output.step;
    }
    trace_reader_destroy(&reader);
    return result == RESULT_CLOSED || result == RESULT_MISSING ? RESULT_OK : result;
}

static enum result resume_at(const char *path, const struct scene *scene,
                             const struct session_settings *settings, uint64_t byte,
                             double *in_out_differences, struct error *err) {
    char head[256];
    uint64_t step = 0;
    snprintf(head, sizeof head, "%s.head", path);
    struct rerun *rerun = rerun_create(scene, settings);
    enum result result = copy_head(path, head, byte, err);
    if (result == RESULT_OK)
        result = rerun_rest(head, rerun, 0, in_out_differences, &step, err);
    if (result == RESULT_OK)
        result = rerun_rest(path, rerun, step + 1, in_out_differences, &step, err);
    rerun_destroy(&rerun);
    unlink(head);
    return result;
}

enum result bench_trace_resume(const char *path, const struct scene *scene, int times,
                               double *out_differences, struct error *err) {
    struct trace_reader *reader;
    struct random random = {7};
    enum result result = trace_reader_create(path, &reader, err);
    if (result != RESULT_OK)
        return result;
    struct session_settings settings = trace_reader_header(reader)->settings;
    double first = (double)trace_reader_offset(reader), size = (double)trace_reader_size(reader);
    trace_reader_destroy(&reader);
    *out_differences = 0;
    for (int i = 0; i < times && result == RESULT_OK; i++)
        result = resume_at(path, scene, &settings, (uint64_t)random_between(&random, first, size),
                           out_differences, err);
    return result;
}
