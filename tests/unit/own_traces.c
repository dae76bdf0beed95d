// Which traces without an end the server goes on with, and signs.
#include "folder.h"
#include "sessions/own.h"
#include "sessions/parts.h"
#include "test.h"

#include <stdio.h>

static void with_records_that_cannot_be_read_no_trace_counts_that_nobody_noted(void **state) {
    (void)state;
    static struct sessions s;
    char folder[FOLDER_MAX], trace[FOLDER_MAX + 32];
    folder_make(folder);
    snprintf(s.config.records, sizeof s.config.records, "%s/records.db", folder);
    snprintf(s.config.traces_dir, sizeof s.config.traces_dir, "%s", folder);
    snprintf(trace, sizeof trace, "%s/forged.trace", folder);
    FILE *file = fopen(s.config.records, "w");
    assert_non_null(file);
    fputs("no database", file);
    fclose(file);
    own_traces_read(&s);
    assert_false(own_traces_have(&s, trace));
    own_traces_free(&s);
    s.config.records[0] = '\0'; // a server without records has no other sign
    own_traces_read(&s);
    assert_true(own_traces_have(&s, trace));
    folder_remove(folder);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(with_records_that_cannot_be_read_no_trace_counts_that_nobody_noted),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
