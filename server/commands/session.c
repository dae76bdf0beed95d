#include "step/session.h"

#include "base/argument.h"
#include "base/check.h"
#include "commands/commands.h"
#include "commands/session_answer.h"
#include "net/console.h"

#include <errno.h>
#include <getopt.h>
#include <inttypes.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define DAY_S 86400
#define CERTIFICATE_WARNING_S (30 * DAY_S)

#define USUAL_SOCKET "/run/arthron/server.sock"

static const char session_help[] =
    "Usage: arthron-server session [--socket PATH] list [--json]\n"
    "       arthron-server session [--socket PATH] show STATION [--json]\n"
    "       arthron-server session [--socket PATH] start|undo STATION [--json]\n"
    "       arthron-server session [--socket PATH] pause|stop|reset|leave STATION [--reason TEXT]\n"
    "       arthron-server session [--socket PATH] case STATION CASE [--strength S] [--json]\n"
    "       arthron-server session [--socket PATH] note STATION TEXT [--json]\n"
    "       arthron-server session [--socket PATH] assign STATION TRAINEE [--json]\n"
    "       arthron-server session [--socket PATH] begin STATION TASK [--exam] [--left] [--json]\n"
    "       arthron-server session [--socket PATH] copy STATION --from TRACE|ID [--at S] [--json]\n"
    "\n"
    "Commands a running server through its local socket. Run it as the server's user.\n"
    "\n"
    "  list    all stations with their sessions and trainees; lost: frames that did not arrive\n"
    "  show    the session of one station: the joint, what was cut, the metrics\n"
    "  start   starts a waiting or paused session, or a new one after the last has ended\n"
    "  pause   freezes the session until start\n"
    "  stop    ends the session and closes its trace\n"
    "  reset   makes the tissue whole again, in the same trace\n"
    "  undo    removes the last stroke: a bite, a press of the shaver's button, or a pass of the\n"
    "          knife. Repeat it to go further back\n"
    "  case    ends the session and opens one on another case of the server's config\n"
    "  note    shows a text to the trainee\n"
    "  assign  names the trainee of the next session; '': none\n"
    "  begin   begins an attempt at a task; practice with the scope in the right hand\n"
    "  leave   ends the attempt that runs\n"
    "  copy    ends the session and opens one that continues a recorded one: with its cuts, its\n"
    "          touch and its warp settings. The server's config must have its case\n"
    "\n"
    "  -S, --socket PATH  the server's socket, as in its config (default: that of the package,\n"
    "                     " USUAL_SOCKET ")\n"
    "      --from TRACE   the recorded session: its trace, or its id (32 hexadecimal digits)\n"
    "      --at S         continue it from S seconds after its start (default: from its end)\n"
    "      --strength S   the strength of the new session's warp, 0 to 1 (default: the config's)\n"
    "      --exam         the attempt is of an exam\n"
    "      --left         the left hand holds the scope\n"
    "      --reason TEXT  why you pause, stop, reset, leave, copy or change the case while an "
    "exam\n"
    "                     runs. It flags the exam\n"
    "      --json         print JSON\n"
    "      --help         show this\n";

static const char session_command[] = "arthron-server session";

static const struct command_kind {
    const char *name, *usage;
    arthron_Command_Kind kind;
    int arguments;
} kinds[] = {
    {"list", "list", arthron_Command_Kind_LIST, 0},
    {"show", "show STATION", arthron_Command_Kind_SHOW, 1},
    {"start", "start STATION", arthron_Command_Kind_START, 1},
    {"pause", "pause STATION", arthron_Command_Kind_PAUSE, 1},
    {"stop", "stop STATION", arthron_Command_Kind_STOP, 1},
    {"reset", "reset STATION", arthron_Command_Kind_RESET, 1},
    {"undo", "undo STATION", arthron_Command_Kind_UNDO, 1},
    {"case", "case STATION CASE [--strength S]", arthron_Command_Kind_CASE, 2},
    {"note", "note STATION TEXT", arthron_Command_Kind_NOTE, 2},
    {"assign", "assign STATION TRAINEE", arthron_Command_Kind_ASSIGN, 2},
    {"begin", "begin STATION TASK [--exam] [--left]", arthron_Command_Kind_BEGIN, 2},
    {"leave", "leave STATION", arthron_Command_Kind_LEAVE, 1},
    {"copy", "copy STATION --from TRACE|ID [--at S]", arthron_Command_Kind_COPY, 1},
};

enum { KIND_COUNT = sizeof kinds / sizeof *kinds };

static const char *state_name(const arthron_SessionInfo *info) {
    return session_state_name((enum session_state)info->state);
}

// Who trains, and who will.
static void print_next_trainee(const arthron_SessionInfo *info) {
    const char *next = info->next_trainee;
    if (strcmp(info->trainee, next) != 0)
        printf("  %s: %s from the next session on\n", info->station, *next ? next : "nobody");
}

// Nothing where it is unknown or good for long.
static void print_certificate(const char *whose, int64_t until_utc_s, const char *advice) {
    int64_t left_s = until_utc_s - time(NULL);
    if (until_utc_s && left_s < CERTIFICATE_WARNING_S)
        printf("  %s: its certificate ends in %d days: %s\n", whose, (int)(left_s / DAY_S), advice);
}

static void print_table(const struct session_answer *answer) {
    printf("%-20s %-20s %-20s %-8s %-9s %10s %8s  %s\n", "station", "trainee", "case", "state",
           "link", "steps", "lost", "trace");
    for (size_t i = 0; i < answer->session_count; i++) {
        const arthron_SessionInfo *info = &answer->sessions[i];
        printf("%-20s %-20s %-20s %-8s %-9s %10" PRIu64 " %8" PRIu64 "  %s\n", info->station,
               info->trainee[0] ? info->trainee : "-", info->case_name, state_name(info),
               info->connected ? "connected" : "away", info->steps, info->frames_lost, info->trace);
        print_next_trainee(info);
        if (strncmp(info->case_grade, "fit", 3) != 0)
            printf("  %s: its case is %s\n", info->station, info->case_grade);
        print_certificate(info->station, info->certificate_until_utc_s, "enrol it again");
        if (info->calibration_problem[0])
            printf("  %s: %s\n", info->station, info->calibration_problem);
        if (info->trace_missing)
            printf("  %s: its trace is incomplete, %" PRIu64 " steps are missing\n", info->station,
                   info->trace_missing);
        if (info->trace_failing)
            printf("  %s: its trace cannot be written to the disk\n", info->station);
        if (info->touches)
            printf("  %s: %" PRIu64 " touches, tip %.2f mm off the surface\n", info->station,
                   info->touches, info->drift_mm);
    }
    print_certificate("the server", answer->reply.certificate_until_utc_s,
                      "arthron-server keys renew");
}

// Without the sign of a rest that rounding left.
static double shown(double mm3) {
    return fabs(mm3) < 0.05 ? 0 : mm3;
}

static void print_resection(const arthron_Resection *r) {
    if (r->mesh_number <= 1 && !r->cuts_refused) {
        printf("%s: %.1f mm3, not cut\n", r->group, r->volume_mm3);
        return;
    }
    printf("%s: %u cuts took %.1f mm3 of %.1f", r->group, r->cuts, r->removed_mm3 + r->pieces_mm3,
           r->volume_mm3 + r->removed_mm3 + r->pieces_mm3);
    if (r->pieces)
        printf(", and %u piece%s of %.2f mm3 came off", r->pieces, r->pieces == 1 ? "" : "s",
               r->pieces_mm3);
    if (r->planned_mm3 > 0)
        printf("\n  plan: %.1f mm3, taken beyond it %.1f, not yet taken %.1f; damaged tissue left "
               "%.1f",
               r->planned_mm3, shown(r->over_mm3), shown(r->under_mm3), shown(r->damage_mm3));
    printf("\n  rim %.2f mm at its narrowest, largest step of the contour %.2f mm\n", r->rim_mm,
           r->step_mm);
    printf("  touch: %.1f mm3 not matched, at most %.2f mm off the cut; %u cuts refused\n",
           shown(r->left_mm3), r->distance_mm, r->cuts_refused);
    if (r->touched_unseen_mm3 + r->seen_untouched_mm3 > 0)
        printf("  %.1f mm3 are touched where nothing is seen, %.1f mm3 seen where nothing is "
               "touched\n",
               r->touched_unseen_mm3, r->seen_untouched_mm3);
}

static void print_joint(const arthron_JointReading *reading) {
    const arthron_Joint *j = &reading->joint;
    printf("joint %s: flexion %.2f varus %.2f internal %.2f degrees, shift %.2f drawer %.2f "
           "distraction %.2f mm\n",
           validity_name((enum validity)reading->validity), j->flexion_deg, j->varus_deg,
           j->internal_deg, j->shift_mm, j->drawer_mm, j->distraction_mm);
}

static void print_metric(const arthron_Metric *m) {
    char value[48] = "-";
    if (isfinite(m->value))
        snprintf(value, sizeof value, m->below_floor ? "(%.4g)" : "%.4g", m->value);
    printf("%-20s v%u %12s %-5s %s\n", m->name, m->version, value, m->unit, m->subject);
}

static void print_text(const struct session_answer *answer) {
    const arthron_CommandReply *reply = &answer->reply;
    if (answer->session_count)
        print_table(answer);
    if (reply->has_undone)
        printf("%u cut%s undone, %.1f mm3 came back\n", reply->undone.cuts,
               reply->undone.cuts == 1 ? "" : "s", reply->undone.volume_mm3);
    if (reply->has_joint)
        print_joint(&reply->joint);
    for (pb_size_t i = 0; i < reply->resections_count; i++)
        print_resection(&reply->resections[i]);
    for (pb_size_t i = 0; i < answer->metrics.metrics_count; i++)
        print_metric(&answer->metrics.metrics[i]);
}

// ---- asking -------------------------------------------------------------------------------------

static void add_sessions(struct session_answer *answer) {
    size_t more = answer->reply.sessions_count;
    answer->sessions =
        alloc_resize(answer->sessions, answer->session_count + more, sizeof *answer->sessions);
    memcpy(answer->sessions + answer->session_count, answer->reply.sessions,
           more * sizeof *answer->sessions);
    answer->session_count += more;
}

// A list comes in parts.
static enum result ask_server(const char *socket, const arthron_Command *command,
                              struct session_answer *out, struct error *err) {
    arthron_Command part = *command;
    enum result result;
    do {
        result = console_call(socket, &part, &out->reply, err);
        if (result == RESULT_OK)
            add_sessions(out);
        part.first = (uint32_t)out->session_count;
    } while (result == RESULT_OK && out->reply.next == part.first && part.first);
    if (result == RESULT_OK && out->reply.ok && command->kind == arthron_Command_Kind_SHOW)
        result = console_ask_metrics(socket, command->station, &out->metrics, err);
    return result;
}

static int call(const char *socket, const arthron_Command *command, bool json) {
    static struct session_answer answer;
    struct error err;
    if (ask_server(socket, command, &answer, &err) != RESULT_OK) {
        fprintf(stderr, "arthron-server session: %s\n", err.text);
        return 1;
    }
    (json ? session_print_json : print_text)(&answer);
    if (!answer.reply.ok)
        fprintf(stderr, "arthron-server session: %s\n", answer.reply.text);
    free(answer.sessions);
    return answer.reply.ok ? 0 : 1;
}

static bool put_text(char *out, size_t size, const char *text) {
    return snprintf(out, size, "%s", text) < (int)size;
}

// What the third word of the command is.
static bool fill_last(const char *word, arthron_Command *out) {
    if (out->kind == arthron_Command_Kind_BEGIN)
        return put_text(out->task, sizeof out->task, word);
    if (out->kind == arthron_Command_Kind_ASSIGN)
        return put_text(out->trainee, sizeof out->trainee, word);
    out->has_remark = out->kind == arthron_Command_Kind_NOTE;
    if (out->has_remark)
        return put_text(out->remark.text, sizeof out->remark.text, word);
    return put_text(out->case_name, sizeof out->case_name, word);
}

static const struct command_kind *find_kind(const char *word) {
    for (int i = 0; i < KIND_COUNT; i++)
        if (!strcmp(word, kinds[i].name))
            return &kinds[i];
    return NULL;
}

static int refuse_kind(const char *word) {
    const char *names[KIND_COUNT + 1] = {NULL};
    for (int i = 0; i < KIND_COUNT; i++)
        names[i] = kinds[i].name;
    return argument_unknown(session_command, "command", word, names);
}

static bool fits(const struct command_kind *kind, int count, const arthron_Command *command,
                 const char *from) {
    bool copies = kind->kind == arthron_Command_Kind_COPY;
    bool begins = kind->kind == arthron_Command_Kind_BEGIN;
    return (begins || (!command->purpose && !command->hand)) && count == kind->arguments + 1 &&
           copies == !!from && (copies || command->at_s == 0) &&
           (kind->kind == arthron_Command_Kind_CASE || !command->has_strength);
}

// False where a word is longer than any that the server knows.
static bool fill_command(char **words, int count, arthron_Command *out) {
    return (count < 2 || put_text(out->station, sizeof out->station, words[1])) &&
           (count < 3 || fill_last(words[2], out));
}

static bool take_strength(const char *text, arthron_Command *out) {
    char *end;
    out->has_strength = true;
    out->strength = strtod(text, &end);
    return *text && !*end && out->strength >= 0 && out->strength <= 1;
}

// The server has another working directory.
static bool take_from(const char *text, arthron_Command *out) {
    char path[PATH_MAX];
    bool is_id = strlen(text) == 32 && strspn(text, "0123456789abcdefABCDEF") == 32;
    if (!is_id && !realpath(text, path)) {
        fprintf(stderr, "arthron-server session: %s: %s\n", text, strerror(errno));
        return false;
    }
    int length = snprintf(out->from, sizeof out->from, "%s", is_id ? text : path);
    if (length >= (int)sizeof out->from)
        fprintf(stderr, "arthron-server session: %s: the path is too long\n", path);
    return length < (int)sizeof out->from;
}

static bool take_at(const char *text, arthron_Command *out) {
    char *end;
    out->at_s = strtod(text, &end);
    return end != text && !*end && isfinite(out->at_s) && out->at_s > 0;
}

// 0, or the exit code of what is wrong.
static int take_value(int option, arthron_Command *out) {
    if (option == 'a' && !take_at(optarg, out))
        return argument_wrong(session_command, "--at %s: must be seconds above 0", optarg);
    if (option == 'W' && !take_strength(optarg, out))
        return argument_wrong(session_command, "--strength %s: must be a number from 0 to 1",
                              optarg);
    if (option == 'r' && !put_text(out->reason, sizeof out->reason, optarg))
        return argument_wrong(session_command, "--reason: must be shorter than %zu bytes",
                              sizeof out->reason);
    return 0;
}

static int run_session_command(const char *socket, const char *from, char **words, int count,
                               arthron_Command *command, bool json) {
    if (!count)
        return argument_wrong(session_command, "the command is missing: list, show, start, ...");
    const struct command_kind *kind = find_kind(words[0]);
    if (!kind)
        return refuse_kind(words[0]);
    if (!fits(kind, count, command, from))
        return argument_wrong(session_command, "usage: %s", kind->usage);
    command->kind = kind->kind;
    if (!fill_command(words, count, command))
        return argument_wrong(session_command, "%s: a name or text is too long", kind->name);
    return !from || take_from(from, command) ? call(socket, command, json) : 1;
}

int command_session(int argc, char **argv) {
    static const struct option options[] = {
        {"socket", required_argument, NULL, 'S'}, {"from", required_argument, NULL, 'f'},
        {"at", required_argument, NULL, 'a'},     {"strength", required_argument, NULL, 'W'},
        {"exam", no_argument, NULL, 'e'},         {"left", no_argument, NULL, 'l'},
        {"reason", required_argument, NULL, 'r'}, {"json", no_argument, NULL, 'j'},
        {"help", no_argument, NULL, 'h'},         {0},
    };
    const char *socket = USUAL_SOCKET, *from = NULL;
    arthron_Command command = arthron_Command_init_zero;
    bool json = false;
    int code = 0;
    for (int o; !code && (o = getopt_long(argc, argv, "S:", options, NULL)) != -1;) {
        if (o == 'h') {
            fputs(session_help, stdout);
            return 0;
        }
        if (o == '?')
            return argument_help(session_command);
        socket = o == 'S' ? optarg : socket;
        from = o == 'f' ? optarg : from;
        json |= o == 'j';
        if (o == 'e')
            command.purpose = arthron_AttemptState_Purpose_EXAM;
        if (o == 'l')
            command.hand = arthron_AttemptState_Hand_LEFT_HAND;
        code = take_value(o, &command);
    }
    return code ? code
                : run_session_command(socket, from, argv + optind, argc - optind, &command, json);
}
