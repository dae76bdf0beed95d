#include "base/argument.h"
#include "commands/commands.h"
#include "commands/records_password.h"
#include "commands/sealed_file.h"
#include "store/store.h"

#include <errno.h>
#include <fcntl.h>
#include <getopt.h>
#include <limits.h>
#include <openssl/crypto.h>
#include <stdio.h>
#include <string.h>
#include <sys/file.h>
#include <unistd.h>

static const char backup_help[] =
    "Usage: arthron-server backup --file FILE --out BACKUP [--passphrase FILE]\n"
    "\n"
    "Copies the records, as they are at one moment, into a new file and checks the copy. The\n"
    "server may run at the same time.\n"
    "\n"
    "  -f, --file FILE        the records, as in the server's config\n"
    "  -o, --out BACKUP       a file that does not exist yet\n"
    "  -p, --passphrase FILE  encrypts the backup with the first line of this file; - reads stdin\n"
    "      --help             show this\n";

static const char restore_help[] =
    "Usage: arthron-server restore BACKUP --file FILE [--passphrase FILE]\n"
    "\n"
    "Replaces the records by a backup, after it has checked that the backup is whole and of a\n"
    "known version. Keeps the replaced file beside it. The server may run at the same time: its\n"
    "sessions go on, and it restores later sessions from their traces.\n"
    "\n"
    "  -f, --file FILE        the records, as in the server's config\n"
    "  -p, --passphrase FILE  of an encrypted backup: a file with its passphrase; - reads stdin\n"
    "      --help             show this\n";

struct backup_request {
    const char *file, *out, *passphrase;
};

static int report_copy(const char *command, enum result result, const struct error *err) {
    if (result == RESULT_OK)
        return 0;
    fprintf(stderr, "arthron-server %s: %s\n", command, err->text);
    return 1;
}

// ---- encrypted ----------------------------------------------------------------------------------

// A file beside the records, which are not encrypted either. Its lock keeps it for one command at a
// time; *out_lock: close it after the draft was removed.
static enum result begin_draft(const char *file, char out[PATH_MAX], int *out_lock,
                               struct error *err) {
    char lock[PATH_MAX];
    if (snprintf(lock, sizeof lock, "%s.backup-lock", file) >= PATH_MAX)
        return fail(err, RESULT_LIMIT, "%s: the path is too long", file);
    snprintf(out, PATH_MAX, "%s.backup-draft", file);
    *out_lock = open(lock, O_WRONLY | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
    if (*out_lock >= 0 && flock(*out_lock, LOCK_EX | LOCK_NB) == 0) {
        unlink(out); // of a backup that was interrupted
        return RESULT_OK;
    }
    bool busy = *out_lock >= 0 && errno == EWOULDBLOCK;
    fail(err, busy ? RESULT_TIMEOUT : RESULT_IO, "%s: %s", lock,
         busy ? "another encrypted backup or restore is under way; try again after it"
              : strerror(errno));
    if (*out_lock >= 0)
        close(*out_lock);
    return busy ? RESULT_TIMEOUT : RESULT_IO;
}

static void end_draft(const char *draft, int lock) {
    unlink(draft);
    close(lock);
}

static enum result back_up_sealed(struct store *store, const struct backup_request *r,
                                  struct error *err) {
    char draft[PATH_MAX], passphrase[PASSPHRASE_MAX];
    int lock;
    enum result result = passphrase_read(r->passphrase, passphrase, err);
    if (result == RESULT_OK)
        result = begin_draft(r->file, draft, &lock, err);
    if (result == RESULT_OK) {
        result = store_backup(store, draft, err);
        if (result == RESULT_OK)
            result = sealed_file_write(draft, passphrase, r->out, err);
        end_draft(draft, lock);
    }
    OPENSSL_cleanse(passphrase, sizeof passphrase);
    return result;
}

static enum result put_back_sealed(const char *backup, const struct backup_request *r,
                                   char out_aside[STORE_TEXT_MAX], struct error *err) {
    char draft[PATH_MAX], passphrase[PASSPHRASE_MAX];
    int lock;
    enum result result = passphrase_read(r->passphrase, passphrase, err);
    if (result == RESULT_OK)
        result = begin_draft(r->file, draft, &lock, err);
    if (result == RESULT_OK) {
        result = sealed_file_read(backup, passphrase, draft, err);
        if (result == RESULT_OK)
            result = store_restore(draft, r->file, records_actor(), out_aside, err);
        end_draft(draft, lock);
    }
    OPENSSL_cleanse(passphrase, sizeof passphrase);
    return result;
}

// Somebody could put a file of their own in the place of an encrypted one.
static enum result check_kind(const char *backup, const struct backup_request *r,
                              struct error *err) {
    bool sealed = sealed_file_is(backup);
    if (sealed && !r->passphrase)
        return fail(err, RESULT_INVALID,
                    "%s: this backup is encrypted; name the file of its passphrase with "
                    "--passphrase FILE",
                    backup);
    if (!sealed && r->passphrase && access(backup, F_OK) == 0)
        return fail(err, RESULT_INVALID,
                    "%s: this backup is not encrypted; leave out --passphrase if you trust it",
                    backup);
    return RESULT_OK;
}

// ---- commands -----------------------------------------------------------------------------------

static int back_up(const struct backup_request *r) {
    struct store *store;
    struct error err;
    enum result result = store_open(r->file, STORE_THERE, records_actor(), &store, &err);
    if (result == RESULT_OK)
        result = r->passphrase ? back_up_sealed(store, r, &err) : store_backup(store, r->out, &err);
    store_close(&store);
    if (result == RESULT_OK)
        fprintf(stderr, "arthron-server backup: wrote %s\n", r->out);
    return report_copy("backup", result, &err);
}

static int put_back(const char *backup, const struct backup_request *r) {
    char aside[STORE_TEXT_MAX] = "";
    struct error err;
    enum result result = check_kind(backup, r, &err);
    if (result == RESULT_OK)
        result = r->passphrase ? put_back_sealed(backup, r, aside, &err)
                               : store_restore(backup, r->file, records_actor(), aside, &err);
    if (aside[0])
        printf("the replaced file is kept: %s\n", aside);
    if (result == RESULT_OK)
        fprintf(stderr, "arthron-server restore: wrote %s\n", r->file);
    return report_copy("restore", result, &err);
}

int command_backup(int argc, char **argv) {
    static const struct option options[] = {{"file", required_argument, NULL, 'f'},
                                            {"out", required_argument, NULL, 'o'},
                                            {"passphrase", required_argument, NULL, 'p'},
                                            {"help", no_argument, NULL, 'h'},
                                            {0}};
    static const char program[] = "arthron-server backup";
    struct backup_request r = {0};
    for (int o; (o = getopt_long(argc, argv, "f:o:p:", options, NULL)) != -1;) {
        if (o == 'h') {
            fputs(backup_help, stdout);
            return 0;
        }
        if (o == '?')
            return argument_help(program);
        *(o == 'f' ? &r.file : o == 'o' ? &r.out : &r.passphrase) = optarg;
    }
    if (!r.file || !r.out || optind != argc)
        return argument_wrong(program,
                              "usage: backup --file FILE --out BACKUP [--passphrase FILE]");
    return back_up(&r);
}

int command_restore(int argc, char **argv) {
    static const struct option options[] = {{"file", required_argument, NULL, 'f'},
                                            {"passphrase", required_argument, NULL, 'p'},
                                            {"help", no_argument, NULL, 'h'},
                                            {0}};
    static const char program[] = "arthron-server restore";
    struct backup_request r = {0};
    for (int o; (o = getopt_long(argc, argv, "f:p:", options, NULL)) != -1;) {
        if (o == 'h') {
            fputs(restore_help, stdout);
            return 0;
        }
        if (o == '?')
            return argument_help(program);
        *(o == 'f' ? &r.file : &r.passphrase) = optarg;
    }
    if (!r.file || optind + 1 != argc)
        return argument_wrong(program, "usage: restore BACKUP --file FILE [--passphrase FILE]");
    return put_back(argv[optind], &r);
}
