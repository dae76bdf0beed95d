#include "replay/recording.h"

#include "test.h"

#include <stdio.h>
#include <time.h>
#include <unistd.h>

struct played played;
char case_dir[FOLDER_MAX + 16], trace_path[FOLDER_MAX + 16];
static char folder[FOLDER_MAX];

int make_session(void **state) {
    (void)state;
    folder_make(folder);
    snprintf(case_dir, sizeof case_dir, "%s/case", folder);
    snprintf(trace_path, sizeof trace_path, "%s/a.trace", folder);
    struct error err = {""};
    if (played_init(CASES, "arthrosis", case_dir, &played, &err) != RESULT_OK) {
        print_error("%s\n", err.text);
        return -1;
    }
    return 0;
}

int remove_session(void **state) {
    (void)state;
    played_fini(&played);
    folder_remove(folder);
    return 0;
}

struct trace_header honest_header(void) {
    struct trace_header header = {
        .case_name = "arthrosis",
        .case_hash = scene_case(played.scene)->hash,
        .settings = session_settings_default(),
        .optic = view_optic_usual(),
    };
    trace_header_set_machine(&header);
    return header;
}

uint64_t recorded_steps;

struct recorder {
    struct trace_writer *writer;
    uint64_t from;                           // the first step that `change` sees
    void (*change)(struct session_output *); // of what is recorded, or NULL
    uint64_t bytes;                          // on disk, at the last wait
};

// No session is so fast that a disk cannot follow.
static void wait_for_disk(struct recorder *r) {
    while (trace_writer_status(r->writer).bytes == r->bytes)
        nanosleep(&(struct timespec){.tv_nsec = 5000000}, NULL);
    r->bytes = trace_writer_status(r->writer).bytes;
}

static void record_step(void *context, const struct session_input *input,
                        const struct session_output *output) {
    struct recorder *r = context;
    struct session_output recorded = *output;
    if (r->change && output->step >= r->from)
        r->change(&recorded);
    assert_true(trace_append(r->writer, input, &recorded));
    if (output->step % 500 == 0)
        wait_for_disk(r);
    recorded_steps = output->step;
}

void record(const struct trace_header *header, uint64_t from,
            void (*change)(struct session_output *)) {
    struct session_settings settings = session_settings_default();
    struct recorder r = {.from = from, .change = change};
    struct error err = {""};
    unlink(trace_path);
    if (trace_writer_create(trace_path, header, NULL, NULL, &r.writer, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    played_run(&played, &settings, played.motion.row_count, record_step, &r);
    trace_writer_destroy(&r.writer);
}
