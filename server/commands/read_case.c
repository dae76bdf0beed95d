#include "commands/read_case.h"

#include "base/number.h"
#include "commands/commands.h"
#include "confine/confine.h"
#include "step/scene.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define READER_CPU_S 120

static struct confine_limits reader_limits = {.memory_mb = 1024, .cpu_s = READER_CPU_S};

void read_case_limit(int memory_mb) {
    reader_limits.memory_mb = memory_mb;
}

static enum result read_all(const char *dir, uint64_t *out_hash, struct error *err) {
    struct knee_case *knee;
    struct scene *scene;
    enum result result = case_load(dir, NULL, &knee, err);
    if (result != RESULT_OK)
        return result;
    *out_hash = knee->hash;
    result = scene_create(&knee, &scene, err);
    if (result == RESULT_OK)
        scene_destroy(&scene);
    else
        case_destroy(&knee);
    return result;
}

// The other process.
int command_read_case(int argc, char **argv) {
    struct error err = {""};
    uint64_t hash = 0;
    int64_t memory_mb;
    if (argc != 3 || !number_int(argv[2], 1, 1 << 20, &memory_mb)) {
        fputs("arthron-server read-case: the server alone uses this command\n", stderr);
        return 2;
    }
    reader_limits.memory_mb = (int)memory_mb;
    confine_self(&reader_limits);
    enum result result = read_all(argv[1], &hash, &err);
    return confine_answer(result, &err, &hash, sizeof hash);
}

enum result read_case_check(const char *dir, uint64_t *out_hash, struct error *err) {
#ifdef CONFINE_SANITIZED // it ends at the fault itself, and has no time to read each case twice
    *out_hash = 0;
    return RESULT_OK;
#endif
    char memory_mb[16];
    uint8_t *answer;
    size_t size;
    snprintf(memory_mb, sizeof memory_mb, "%d", reader_limits.memory_mb);
    const char *const arguments[] = {"arthron-server", "read-case", dir, memory_mb, NULL};
    enum result result = confine_run(arguments, &reader_limits, sizeof err->text, &answer, &size, err);
    if (result == RESULT_LIMIT && strncmp(err->text, dir, strlen(dir)) != 0)
        return fail_in(err, result, "%s: ", dir);
    if (result != RESULT_OK)
        return result;
    if (size == sizeof *out_hash)
        memcpy(out_hash, answer, size);
    else
        result = fail(err, RESULT_FORMAT, "%s: its reader gave no hash", dir);
    free(answer);
    return result;
}
