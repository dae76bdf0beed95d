// An outbox with its sender, for xapi.py: adds each line of stdin to the outbox, until its end.
// Short times, so that the test need not wait.

#include "xapi/sender.h"

#include <stdio.h>
#include <string.h>

int main(int argc, char **argv) {
    struct outbox *outbox;
    struct sender *sender;
    struct error err;
    static char line[OUTBOX_LINE_MAX + 2];
    if (argc != 5)
        return 2;
    const struct sender_config config = {.server = argv[2],
                                         .user = "arthron",
                                         .password = argv[3],
                                         .authority = argv[4],
                                         .patience_ms = 500,
                                         .retry_ms = 20,
                                         .retry_most_ms = 100};
    if (outbox_open(argv[1], true, &outbox, &err) != RESULT_OK ||
        sender_start(&config, outbox, &sender, &err) != RESULT_OK) {
        fprintf(stderr, "%s\n", err.text);
        return 1;
    }
    while (fgets(line, sizeof line, stdin)) {
        line[strcspn(line, "\n")] = '\0';
        if (outbox_add(outbox, line, &err) != RESULT_OK)
            fprintf(stderr, "%s\n", err.text);
        puts("added");
        fflush(stdout);
        sender_wake(sender);
    }
    sender_stop(&sender);
    outbox_close(&outbox);
    return 0;
}
