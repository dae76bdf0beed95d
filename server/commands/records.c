#include "base/argument.h"
#include "base/clock.h"
#include "commands/commands.h"
#include "commands/records_password.h"
#include "commands/records_rows.h"
#include "commands/records_verify.h"
#include "commands/records_xapi.h"
#include "study/study.h"
#include "xapi/words.h"

#include <getopt.h>
#include <pwd.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

static const char records_help[] =
    "Usage: arthron-server records --file FILE list WHAT [--json]\n"
    "       arthron-server records --file FILE show trainee|course|station|account NAME [--json]\n"
    "       arthron-server records --file FILE show session ID [--json]\n"
    "       arthron-server records --file FILE add trainee NAME [--full-name TEXT]\n"
    "       arthron-server records --file FILE add course NAME\n"
    "       arthron-server records --file FILE add account NAME --role ROLE [--trainee NAME]\n"
    "                                      [--password FILE]\n"
    "       arthron-server records --file FILE password NAME [--password FILE]\n"
    "       arthron-server records --file FILE remove account NAME\n"
    "       arthron-server records --file FILE enrol TRAINEE COURSE\n"
    "       arthron-server records --file FILE export --csv DIR | --xapi FILE [--site URL]\n"
    "       arthron-server records --file FILE export --course NAME --zip FILE [--task NAME]\n"
    "                                      [--from DATE] [--to DATE] [--names]\n"
    "       arthron-server records --file FILE erase TRAINEE [--json]\n"
    "       arthron-server records --file FILE verify [--keys DIR] [--entry NUMBER:HASH] [--json]\n"
    "\n"
    "Reads and changes the records. The server may run at the same time.\n"
    "\n"
    "  list      trainees, courses, enrolments, stations, cases, sessions, results, accounts,\n"
    "            tokens, audit, attempts, curricula, marks, exams, exam_tasks, exam_raters,\n"
    "            interventions or ratings\n"
    "  show      one of them: a trainee with the sessions, a course with its trainees, a session\n"
    "            with its results\n"
    "  add       a trainee (as in [station] trainee = NAME of the server's config), a course, or\n"
    "            an account\n"
    "  password  gives an account another password, and signs it out everywhere\n"
    "  remove    removes an account; a trainee's sessions stay\n"
    "  enrol     puts a trainee into a course\n"
    "  export    writes every list as a CSV file, the ended sessions as xAPI statements, or all\n"
    "            attempts of a course as a zip of tables with a codebook\n"
    "  erase     replaces a trainee's name by a pseudonym. Sessions and results stay, attempts,\n"
    "            ratings and exams do not. Lists the traces that still hold the name\n"
    "  verify    calculates the hashes of the audit log again, and checks its signature\n"
    "\n"
    "  -f, --file FILE      the records, as in the server's config\n"
    "      --full-name TEXT the trainee's full name\n"
    "      --role ROLE      technician, instructor or trainee\n"
    "      --trainee NAME   the trainee that the account belongs to\n"
    "      --password FILE  a file with the password, or its argon2 hash, in the first line; -\n"
    "                       reads stdin. Without it a terminal asks for one. A new account that\n"
    "                       has none cannot sign in\n"
    "      --csv DIR, --xapi FILE   where to export to\n"
    "      --keys DIR       the keys of the server that signed the audit log\n"
    "      --entry N:HASH   an entry that the log must have, from the server's log or a backup\n"
    "      --course NAME, --zip FILE   the course whose attempts to export, and where to\n"
    "      --task NAME      only those at this task\n"
    "      --from DATE, --to DATE   only those that began on this day or later, and before that\n"
    "                       day: 2026-09-01, in UTC\n"
    "      --names          names trainees and raters, which are numbers otherwise\n"
    "      --site URL       names your accounts and cases in xAPI (https://HOST/arthron)\n"
    "      --json           print JSON, with hashes and times in ns\n"
    "      --help           show this\n";

static const char records_command[] = "arthron-server records";

struct records_request {
    const char *file, *full_name, *role, *trainee, *password, *csv, *xapi, *site, *keys, *entry;
    const char *course, *zip, *task, *from, *to;
    bool json, names;
    char **words;
    int count;
};

enum { DONE, FAILED };

const char *records_actor(void) {
    const struct passwd *user = getpwuid(getuid());
    return user ? user->pw_name : "unknown";
}

static int report_records(enum result result, const struct error *err) {
    if (result == RESULT_OK)
        return DONE;
    fprintf(stderr, "arthron-server records: %s\n", err->text);
    return FAILED;
}

// What was done, on stderr: stdout is for data.
__attribute__((format(printf, 3, 4))) static int done(enum result result, const struct error *err,
                                                      const char *format, ...) {
    va_list args;
    if (result != RESULT_OK)
        return report_records(result, err);
    fputs("arthron-server records: ", stderr);
    va_start(args, format);
    vfprintf(stderr, format, args);
    va_end(args);
    fputc('\n', stderr);
    return DONE;
}

static void print_json(json_t *json) {
    json_dumpf(json, stdout, JSON_COMPACT);
    putchar('\n');
}

// ---- list, show ---------------------------------------------------------------------------------

static int list(struct store *store, const struct records_request *r) {
    enum store_list which;
    struct error err;
    if (!store_list_from_name(r->words[1], &which)) {
        const char *names[LIST_COUNT + 1] = {NULL};
        for (int i = 0; i < LIST_COUNT; i++)
            names[i] = store_list_name((enum store_list)i);
        return argument_unknown(records_command, "list", r->words[1], names);
    }
    json_t *rows = json_array();
    enum result result = store_rows(store, which, NULL, rows_take, rows, &err);
    if (result == RESULT_OK && r->json)
        print_json(rows);
    else if (result == RESULT_OK)
        rows_print(rows);
    json_decref(rows);
    return report_records(result, &err);
}

// What belongs to a row of a list, for show.
static enum result read_belongings(struct store *store, enum store_list which, const char *name,
                                   json_t *shown, struct error *err) {
    json_t *rows = json_array();
    enum result result = RESULT_OK;
    const char *key = NULL;
    if (which == LIST_TRAINEES) {
        key = "sessions";
        result = store_sessions_of(store, name, rows_take, rows, err);
    } else if (which == LIST_COURSES) {
        key = "trainees";
        result = store_rows(store, LIST_ENROLMENTS, name, rows_take, rows, err);
    } else if (which == LIST_SESSIONS) {
        key = "results";
        result = store_rows(store, LIST_RESULTS, name, rows_take, rows, err);
    }
    if (key)
        json_object_set(shown, key, rows);
    json_decref(rows);
    return result;
}

static void print_shown(const json_t *shown) {
    const char *key;
    json_t *rows;
    json_object_foreach((json_t *)shown, key, rows) {
        if (json_array_size(rows))
            printf("%s:\n", key);
        rows_print(rows);
    }
}

static int show(struct store *store, const struct records_request *r) {
    static const char *const kinds[] = {"trainee", "course",  "station", "case",
                                        "session", "account", NULL};
    char plural[32];
    enum store_list which;
    struct error err;
    snprintf(plural, sizeof plural, "%ss", r->words[1]);
    if (!store_list_from_name(plural, &which) || which == LIST_RESULTS ||
        which == LIST_ENROLMENTS || which == LIST_TOKENS)
        return argument_unknown(records_command, "show", r->words[1], kinds);
    json_t *rows = json_array(), *shown = json_object();
    json_object_set(shown, r->words[1], rows);
    enum result result = store_rows(store, which, r->words[2], rows_take, rows, &err);
    if (result == RESULT_OK && !json_array_size(rows))
        result = fail(&err, RESULT_MISSING, "%s: there is no %s '%.64s'", r->file, r->words[1],
                      r->words[2]);
    if (result == RESULT_OK)
        result = read_belongings(store, which, r->words[2], shown, &err);
    if (result == RESULT_OK && r->json)
        print_json(shown);
    else if (result == RESULT_OK)
        print_shown(shown);
    json_decref(rows);
    json_decref(shown);
    return report_records(result, &err);
}

// ---- add, enrol ---------------------------------------------------------------------------------

static int add_account(struct store *store, const struct records_request *r) {
    char password[STORE_TEXT_MAX];
    enum store_role role;
    struct error err;
    enum result result = RESULT_OK;
    if (!r->role)
        return argument_wrong(records_command, "a new account needs --role");
    if (!store_role_from_name(r->role, &role)) {
        const char *names[ROLE_COUNT + 1] = {NULL};
        for (int i = 0; i < ROLE_COUNT; i++)
            names[i] = store_role_name((enum store_role)i);
        return argument_unknown(records_command, "--role", r->role, names);
    }
    bool given = r->password || isatty(STDIN_FILENO);
    if (given)
        result = records_read_password(r->password, password, &err);
    if (result == RESULT_OK)
        result =
            store_add_account(store, r->words[2], role, given ? password : NULL, r->trainee, &err);
    return done(result, &err, "added account %s%s", r->words[2],
                given ? "" : ", which cannot sign in: it has no password");
}

static int set_password(struct store *store, const struct records_request *r) {
    char password[STORE_TEXT_MAX];
    struct error err;
    enum result result = records_read_password(r->password, password, &err);
    if (result == RESULT_OK)
        result = store_set_password(store, r->words[1], password, &err);
    return done(result, &err, "%s has a new password", r->words[1]);
}

static int remove_one(struct store *store, const struct records_request *r) {
    struct error err;
    if (strcmp(r->words[1], "account") != 0)
        return argument_wrong(records_command, "only an account can be removed");
    return done(store_remove_account(store, r->words[2], &err), &err, "removed account %s",
                r->words[2]);
}

static int add(struct store *store, const struct records_request *r) {
    struct error err;
    if (!strcmp(r->words[1], "trainee"))
        return done(store_add_trainee(store, r->words[2], r->full_name, &err), &err,
                    "added trainee %s", r->words[2]);
    if (!strcmp(r->words[1], "course"))
        return done(store_add_course(store, r->words[2], &err), &err, "added course %s",
                    r->words[2]);
    if (!strcmp(r->words[1], "account"))
        return add_account(store, r);
    static const char *const kinds[] = {"trainee", "course", "account", NULL};
    return argument_unknown(records_command, "add", r->words[1], kinds);
}

static int enrol(struct store *store, const struct records_request *r) {
    struct error err;
    return done(store_enrol(store, r->words[1], r->words[2], &err), &err, "%s is in course %s",
                r->words[1], r->words[2]);
}

// ---- export, erase ------------------------------------------------------------------------------

static enum result export_statements(struct store *store, const struct records_request *r,
                                     struct error *err) {
    char site[XAPI_SITE_MAX];
    int left;
    xapi_usual_site(site);
    enum result result = xapi_export(store, r->xapi, r->site ? r->site : site, &left, err);
    if (result == RESULT_OK && left)
        fprintf(stderr,
                "arthron-server records: %d sessions are left out: they still run, or name no "
                "trainee\n",
                left);
    return result;
}

// The begin of a day in UTC; 0 where it is not given.
static enum result take_day(const char *option, const char *text, int64_t *out_utc_ns,
                            struct error *err) {
    struct tm day = {0};
    *out_utc_ns = 0;
    if (!text)
        return RESULT_OK;
    const char *end = strptime(text, "%Y-%m-%d", &day);
    if (!end || *end)
        return fail(err, RESULT_INVALID, "%s %.40s: not a day like 2026-09-01", option, text);
    *out_utc_ns = timegm(&day) * NS_PER_S;
    return RESULT_OK;
}

static enum result export_study(struct store *store, const struct records_request *r,
                                struct error *err) {
    struct study_request request = {.course = r->course, .task = r->task, .names = r->names};
    FILE *file;
    if (!r->course)
        return fail(err, RESULT_MISSING, "--zip needs --course NAME");
    enum result result = take_day("--from", r->from, &request.from_utc_ns, err);
    if (result == RESULT_OK)
        result = take_day("--to", r->to, &request.to_utc_ns, err);
    if (result == RESULT_OK)
        result = rows_create(r->zip, &file, err);
    if (result != RESULT_OK)
        return result;
    result = study_write(store, &request, file, err);
    enum result closed = rows_close(file, r->zip, result == RESULT_OK ? err : NULL);
    if (result != RESULT_OK)
        unlink(r->zip);
    return result == RESULT_OK ? closed : result;
}

static int export(struct store *store, const struct records_request *r) {
    struct error err;
    if (!r->csv && !r->xapi && !r->zip)
        return argument_wrong(records_command, "export needs --csv DIR, --xapi FILE or --zip FILE");
    enum result result = store_note(store, "export", "records", &err); // before it is done
    if (result == RESULT_OK && r->csv)
        result = rows_export_csv(store, r->csv, &err);
    if (result == RESULT_OK && r->xapi)
        result = export_statements(store, r, &err);
    if (result == RESULT_OK && r->zip)
        result = export_study(store, r, &err);
    return done(result, &err, "wrote %s%s%s%s%s", r->csv ? r->csv : "",
                r->csv && r->xapi ? " and " : "", r->xapi ? r->xapi : "",
                r->zip && (r->csv || r->xapi) ? " and " : "", r->zip ? r->zip : "");
}

static void take_trace(void *traces, const struct store_cell *cells, int count) {
    for (int i = 0; i < count; i++)
        if (!strcmp(cells[i].column, "trace") && cells[i].kind == STORE_TEXT)
            json_array_append_new(traces, json_string(cells[i].text));
}

static void print_erased(const char *pseudonym, json_t *traces, bool json) {
    if (json) {
        json_t *whole = json_pack("{s:s, s:O}", "pseudonym", pseudonym, "traces", traces);
        print_json(whole);
        json_decref(whole);
        return;
    }
    printf("now %s\n", pseudonym);
    if (json_array_size(traces))
        puts("these traces still hold the name:");
    for (size_t i = 0; i < json_array_size(traces); i++)
        printf("%s\n", json_string_value(json_array_get(traces, i)));
}

static int erase(struct store *store, const struct records_request *r) {
    char pseudonym[STORE_NAME_MAX];
    struct error err;
    json_t *traces = json_array();
    enum result result = store_erase_trainee(store, r->words[1], pseudonym, &err);
    if (result == RESULT_OK)
        result = store_sessions_of(store, pseudonym, take_trace, traces, &err);
    if (result == RESULT_OK)
        print_erased(pseudonym, traces, r->json);
    json_decref(traces);
    return report_records(result, &err);
}

static int verify(struct store *store, const struct records_request *r) {
    struct error err;
    json_t *said;
    enum result result = records_verify(store, r->keys, r->entry, &said, &err);
    if (result == RESULT_OK && r->json)
        print_json(said);
    else if (result == RESULT_OK)
        records_verify_print(said);
    json_decref(said);
    return report_records(result, &err);
}

// ---- arguments ----------------------------------------------------------------------------------

static const struct verb {
    const char *name, *usage;
    int words;
    enum store_mode mode;
    int (*run)(struct store *store, const struct records_request *r);
} verbs[] = {
    {"list", "list WHAT", 2, STORE_THERE, list},
    {"show", "show KIND NAME", 3, STORE_THERE, show},
    {"add", "add KIND NAME", 3, STORE_MAKE, add},
    {"password", "password NAME", 2, STORE_THERE, set_password},
    {"remove", "remove account NAME", 3, STORE_THERE, remove_one},
    {"enrol", "enrol TRAINEE COURSE", 3, STORE_THERE, enrol},
    {"export", "export --csv DIR | --xapi FILE | --course NAME --zip FILE", 1, STORE_THERE, export},
    {"erase", "erase TRAINEE", 2, STORE_THERE, erase},
    {"verify", "verify", 1, STORE_THERE, verify},
};

enum { VERB_COUNT = sizeof verbs / sizeof *verbs };

static int run_verb(const struct verb *verb, const struct records_request *r) {
    struct store *store;
    struct error err;
    if (r->count != verb->words)
        return argument_wrong(records_command, "usage: %s", verb->usage);
    if (store_open(r->file, verb->mode, records_actor(), &store, &err) != RESULT_OK)
        return report_records(RESULT_IO, &err);
    int code = verb->run(store, r);
    store_close(&store);
    return code;
}

static int find_and_run(const struct records_request *r) {
    const char *names[VERB_COUNT + 1] = {NULL};
    if (!r->file)
        return argument_wrong(records_command,
                              "--file FILE is missing: the records, as in the server's config");
    if (!r->count)
        return argument_wrong(records_command, "the command is missing: list, show, add, ...");
    for (size_t i = 0; i < VERB_COUNT; i++) {
        names[i] = verbs[i].name;
        if (!strcmp(r->words[0], verbs[i].name))
            return run_verb(&verbs[i], r);
    }
    return argument_unknown(records_command, "command", r->words[0], names);
}

// False where an argument is unknown; getopt has named it.
static bool take_records_option(int option, struct records_request *r) {
    const char **const texts[] = {
        ['f'] = &r->file,     ['n'] = &r->full_name, ['r'] = &r->role,   ['t'] = &r->trainee,
        ['p'] = &r->password, ['c'] = &r->csv,       ['x'] = &r->xapi,   ['s'] = &r->site,
        ['k'] = &r->keys,     ['e'] = &r->entry,     ['C'] = &r->course, ['z'] = &r->zip,
        ['T'] = &r->task,     ['F'] = &r->from,      ['O'] = &r->to};
    if (option == 'j')
        return r->json = true;
    if (option == 'N')
        return r->names = true;
    if (option <= 0 || (size_t)option >= sizeof texts / sizeof *texts || !texts[option])
        return false;
    *texts[option] = optarg;
    return true;
}

int command_records(int argc, char **argv) {
    static const struct option options[] = {
        {"file", required_argument, NULL, 'f'},
        {"full-name", required_argument, NULL, 'n'},
        {"role", required_argument, NULL, 'r'},
        {"trainee", required_argument, NULL, 't'},
        {"password", required_argument, NULL, 'p'},
        {"csv", required_argument, NULL, 'c'},
        {"xapi", required_argument, NULL, 'x'},
        {"site", required_argument, NULL, 's'},
        {"keys", required_argument, NULL, 'k'},
        {"entry", required_argument, NULL, 'e'},
        {"course", required_argument, NULL, 'C'},
        {"zip", required_argument, NULL, 'z'},
        {"task", required_argument, NULL, 'T'},
        {"from", required_argument, NULL, 'F'},
        {"to", required_argument, NULL, 'O'},
        {"names", no_argument, NULL, 'N'},
        {"json", no_argument, NULL, 'j'},
        {"help", no_argument, NULL, 'h'},
        {0},
    };
    struct records_request request = {0};
    for (int o; (o = getopt_long(argc, argv, "f:", options, NULL)) != -1;) {
        if (o == 'h') {
            fputs(records_help, stdout);
            return 0;
        }
        if (!take_records_option(o, &request))
            return argument_help(records_command);
    }
    request.words = argv + optind;
    request.count = argc - optind;
    return find_and_run(&request);
}
