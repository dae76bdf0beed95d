#include "base/argument.h"
#include "commands/commands.h"
#include "store/store.h"

#include <getopt.h>
#include <stdio.h>

static const char backup_help[] =
    "Usage: arthron-server backup --file FILE --out BACKUP\n"
    "\n"
    "Copies the records, as they are at one moment, into a new file and checks the copy. The\n"
    "server may run at the same time.\n"
    "\n"
    "  -f, --file FILE    the records, as in the server's config\n"
    "  -o, --out BACKUP   a file that does not exist yet\n"
    "      --help         show this\n";

static const char restore_help[] =
    "Usage: arthron-server restore BACKUP --file FILE\n"
    "\n"
    "Replaces the records by a backup, after it has checked that the backup is whole and of a\n"
    "known version. Keeps the replaced file beside it. The server may run at the same time: its\n"
    "sessions go on, and it restores later sessions from their traces.\n"
    "\n"
    "  -f, --file FILE  the records, as in the server's config\n"
    "      --help       show this\n";

static int report(const char *command, enum result result, const struct error *err) {
    if (result == RESULT_OK)
        return 0;
    fprintf(stderr, "arthron-server %s: %s\n", command, err->text);
    return 1;
}

static int back_up(const char *file, const char *out) {
    struct store *store;
    struct error err;
    enum result result = store_open(file, STORE_THERE, records_actor(), &store, &err);
    if (result == RESULT_OK)
        result = store_backup(store, out, &err);
    store_close(&store);
    if (result == RESULT_OK)
        fprintf(stderr, "arthron-server backup: wrote %s\n", out);
    return report("backup", result, &err);
}

static int put_back(const char *backup, const char *file) {
    char aside[STORE_TEXT_MAX];
    struct error err;
    enum result result = store_restore(backup, file, records_actor(), aside, &err);
    if (aside[0])
        printf("the replaced file is kept: %s\n", aside);
    if (result == RESULT_OK)
        fprintf(stderr, "arthron-server restore: wrote %s\n", file);
    return report("restore", result, &err);
}

int command_backup(int argc, char **argv) {
    static const struct option options[] = {{"file", required_argument, NULL, 'f'},
                                            {"out", required_argument, NULL, 'o'},
                                            {"help", no_argument, NULL, 'h'},
                                            {0}};
    static const char program[] = "arthron-server backup";
    const char *file = NULL, *out = NULL;
    for (int o; (o = getopt_long(argc, argv, "f:o:", options, NULL)) != -1;) {
        if (o == 'h') {
            fputs(backup_help, stdout);
            return 0;
        }
        if (o == '?')
            return argument_help(program);
        *(o == 'f' ? &file : &out) = optarg;
    }
    if (!file || !out || optind != argc)
        return argument_wrong(program, "usage: backup --file FILE --out BACKUP");
    return back_up(file, out);
}

int command_restore(int argc, char **argv) {
    static const struct option options[] = {
        {"file", required_argument, NULL, 'f'}, {"help", no_argument, NULL, 'h'}, {0}};
    static const char program[] = "arthron-server restore";
    const char *file = NULL;
    for (int o; (o = getopt_long(argc, argv, "f:", options, NULL)) != -1;) {
        if (o == 'h') {
            fputs(restore_help, stdout);
            return 0;
        }
        if (o == '?')
            return argument_help(program);
        file = optarg;
    }
    if (!file || optind + 1 != argc)
        return argument_wrong(program, "usage: restore BACKUP --file FILE");
    return put_back(argv[optind], file);
}
