#include "commands/commands.h"
#include "store/store.h"

#include <getopt.h>
#include <stdio.h>

static const char backup_help[] =
    "Usage: arthron-server backup --file FILE --out BACKUP\n"
    "\n"
    "Copies the records as they are at one moment into a new file, and checks it. The server may\n"
    "run meanwhile.\n"
    "\n"
    "  -f, --file FILE    the records, as in the server's config\n"
    "  -o, --out BACKUP   a file that is not there yet\n"
    "      --help         show this\n";

static const char restore_help[] =
    "Usage: arthron-server restore BACKUP --file FILE\n"
    "\n"
    "Puts a backup in the place of the records, once it is found whole and of a version that this\n"
    "program knows. What was there is kept beside it. The server may run meanwhile: its sessions\n"
    "go on, and it brings back those that began or ended since the backup from their traces.\n"
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
        printf("what was there is kept: %s\n", aside);
    if (result == RESULT_OK)
        fprintf(stderr, "arthron-server restore: wrote %s\n", file);
    return report("restore", result, &err);
}

static int usage(const char *help, bool asked) {
    fputs(help, asked ? stdout : stderr);
    return asked ? 0 : 2;
}

int command_backup(int argc, char **argv) {
    static const struct option options[] = {{"file", required_argument, NULL, 'f'},
                                            {"out", required_argument, NULL, 'o'},
                                            {"help", no_argument, NULL, 'h'},
                                            {0}};
    const char *file = NULL, *out = NULL;
    for (int o; (o = getopt_long(argc, argv, "f:o:", options, NULL)) != -1;) {
        if (o == 'f')
            file = optarg;
        else if (o == 'o')
            out = optarg;
        else
            return usage(backup_help, o == 'h');
    }
    return file && out && optind == argc ? back_up(file, out) : usage(backup_help, false);
}

int command_restore(int argc, char **argv) {
    static const struct option options[] = {
        {"file", required_argument, NULL, 'f'}, {"help", no_argument, NULL, 'h'}, {0}};
    const char *file = NULL;
    for (int o; (o = getopt_long(argc, argv, "f:", options, NULL)) != -1;) {
        if (o != 'f')
            return usage(restore_help, o == 'h');
        file = optarg;
    }
    bool complete = file && optind + 1 == argc;
    return complete ? put_back(argv[optind], file) : usage(restore_help, false);
}
