#include "sessions/commands.h"

#include "base/clock.h"
#include "base/log.h"
#include "runtime/reply.h"
#include "sessions/attempts.h"
#include "sessions/audit.h"
#include "sessions/course.h"
#include "sessions/fork.h"
#include "sessions/manager.h"
#include "sessions/remark_command.h"
#include "sessions/session_list.h"
#include "store/text.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define UNDO_WAIT_S 60
#define TICKET_WAIT_NS (5 * NS_PER_S)

// ---- undo ---------------------------------------------------------------------------------------

static bool refuse_nothing_to_undo(const struct sessions *s, int station,
                                   arthron_CommandReply *reply) {
    return reply_refuse_as(reply, arthron_Why_Code_NO_CUT, NULL,
                           "station %s: there is no cut to be undone", station_name(s, station));
}

static bool ask_for_undo(struct sessions *s, int station, arthron_CommandReply *reply) {
    struct station_slot *slot = &s->slots[station];
    struct station_status status;
    uint64_t ticket;
    bool done;
    station_slot_status(slot, &status);
    if (!scene_tissue_count(s->scenes[status.about.scene])) // no job would come
        return refuse_nothing_to_undo(s, station, reply);
    if (!station_slot_begin_undo(slot, &ticket))
        return reply_refuse_as(reply, arthron_Why_Code_UNDO_RUNS, NULL,
                               "station %s: an undo is on its way", station_name(s, station));
    bool answered = runtime_input(s->runtime, station, INPUT_UNDO, ticket) &&
                    station_slot_wait_taken(slot, ticket, clock_now_ns() + TICKET_WAIT_NS, &done);
    if (answered && done)
        return reply->ok = true;
    station_slot_cancel_undo(slot);
    return reply_refuse_as(reply, answered ? arthron_Why_Code_UNDO_RUNS : arthron_Why_Code_BUSY,
                           NULL,
                           answered ? "station %s: an undo is on its way, or its session ended"
                                    : "station %s: its worker is too busy",
                           station_name(s, station));
}

// Without the command lock: the session can be paused or stopped meanwhile.
static void wait_for_undo(struct sessions *s, int station, arthron_CommandReply *reply) {
    struct undo_answer undone;
    int64_t until_ns = clock_now_ns() + UNDO_WAIT_S * NS_PER_S;
    bool answered = station_slot_end_undo(&s->slots[station], until_ns, &undone);
    if (answered && undone.outcome == JOB_NOTHING)
        refuse_nothing_to_undo(s, station, reply);
    else if (!answered && sessions_are_ending(s))
        reply_refuse_as(reply, arthron_Why_Code_ENDING, NULL, "station %s: the server ends",
                        station_name(s, station));
    else if (!answered)
        reply_refuse_as(reply, arthron_Why_Code_UNDO_TOO_LONG, NULL,
                        "station %s: its session ended, or is too busy to undo a stroke in %d s",
                        station_name(s, station), UNDO_WAIT_S);
    reply->has_undone = reply->ok;
    reply->undone.cuts = undone.cuts;
    reply->undone.volume_mm3 = undone.volume_mm3;
}

// ---- which session it is ------------------------------------------------------------------------

// A station that is away meets the new case when it comes.
static bool change_case(struct sessions *s, int station, const arthron_Command *command,
                        arthron_CommandReply *reply) {
    struct station_status status;
    struct error unfit;
    int scene = sessions_find_case(&s->config, command->case_name);
    if (scene < 0)
        return reply_refuse_as(reply, arthron_Why_Code_NO_CASE, command->case_name,
                               "there is no case %s", command->case_name);
    if (command->has_strength && !(command->strength >= 0 && command->strength <= 1))
        return reply_refuse_as(reply, arthron_Why_Code_WRONG_STRENGTH, NULL,
                               "the strength of a warp is from 0 to 1");
    grades_refresh(s->grades);
    if (grades_allow(s->grades, scene, &unfit) != RESULT_OK)
        return reply_refuse(reply, "%s", unfit.text);
    if (!course_stop(s, station, reply))
        return false;
    station_slot_set_case(&s->slots[station], scene,
                          command->has_strength ? command->strength : NAN);
    station_slot_status(&s->slots[station], &status);
    return reply->ok = !status.connected || course_open(s, station, reply);
}

static bool assign(struct sessions *s, int station, const char *trainee,
                   arthron_CommandReply *reply) {
    struct error err;
    // Empty for nobody, or else a name that the records take.
    if (trainee[0] && text_check(trainee, "trainee's name", STORE_NAME_MAX, &err) != RESULT_OK)
        return reply_refuse(reply, "%s", err.text);
    station_slot_set_trainee(&s->slots[station], trainee);
    return reply->ok = true;
}

// ---- who trains ---------------------------------------------------------------------------------

static bool is_of(const struct station_status *status, const char *trainee) {
    return status->phase != SLOT_EMPTY && !strcmp(status->about.trainee, trainee);
}

// A trainee learns neither which stations there are nor which have a session.
static bool refuse_trainee(const char *station, arthron_CommandReply *reply) {
    return reply_refuse(reply, "station %s: it has no session of yours", station);
}

static bool is_theirs(struct sessions *s, int station, const char *trainee,
                      arthron_CommandReply *reply) {
    struct station_status status;
    station_slot_status(&s->slots[station], &status);
    return !trainee[0] || is_of(&status, trainee) ||
           refuse_trainee(station_name(s, station), reply);
}

static bool ask_for_help(struct sessions *s, int station, arthron_CommandReply *reply) {
    struct station_status status;
    station_slot_status(&s->slots[station], &status);
    station_slot_set_help(&s->slots[station], status.about.serial);
    return reply->ok = true;
}

// Why a trainee may not have the station now; NULL: they may.
static const char *in_the_way(const struct station_status *status, const char *trainee) {
    if (status->phase != SLOT_EMPTY && status->about.trainee[0] && !is_of(status, trainee))
        return "somebody else trains there";
    if (status->trainee[0] && strcmp(status->trainee, trainee))
        return "an instructor keeps it for somebody else";
    if (status->phase != SLOT_EMPTY && status->state == SESSION_PAUSED)
        return "an instructor paused its session";
    return NULL;
}

// An own session goes on. One of nobody makes way.
static bool take_station_command(struct sessions *s, int station, const char *trainee,
                                 arthron_CommandReply *reply) {
    struct station_slot *slot = &s->slots[station];
    struct station_status status;
    station_slot_status(slot, &status);
    if (!trainee[0])
        return reply_refuse(reply, "who takes a station is a trainee");
    const char *why = in_the_way(&status, trainee);
    if (why)
        return reply_refuse(reply, "station %s: %s", station_name(s, station), why);
    if (!is_of(&status, trainee) &&
        (!course_stop(s, station, reply) || !assign(s, station, trainee, reply)))
        return false;
    station_slot_set_stopped(slot, false);
    return course_open(s, station, reply) &&
           (status.state == SESSION_RUNNING && is_of(&status, trainee)
                ? (reply->ok = true)
                : course_input(s, station, INPUT_START, SESSION_RUNNING, reply));
}

// Trainees end their own, and the station is free for the next.
static bool stop(struct sessions *s, int station, const char *trainee,
                 arthron_CommandReply *reply) {
    if (trainee[0])
        attempts_leave_own(s, station);
    if (!course_stop(s, station, reply))
        return false;
    return !trainee[0] || assign(s, station, "", reply);
}

// The long part, the other session run again, comes before the command lock.
static void copy_session(struct sessions *s, int station, const arthron_Command *command,
                         arthron_CommandReply *reply) {
    struct station_slot *slot = &s->slots[station];
    struct fork *fork;
    struct error err;
    if (!(command->at_s >= 0)) {
        reply_refuse_as(reply, arthron_Why_Code_WRONG_TIME, NULL,
                        "%g s: a session is copied at its end or at a time after its start",
                        command->at_s);
        return;
    }
    double at_s = command->at_s > 0 ? command->at_s : INFINITY;
    if (fork_create(s, station, command->from, at_s, &fork, &err) != RESULT_OK) {
        reply_refuse(reply, "%s", err.text);
        return;
    }
    pthread_mutex_lock(&slot->command_lock);
    fork_begin(fork, reply);
    session_info(s, station, &reply->sessions[0]);
    reply->sessions_count = 1;
    pthread_mutex_unlock(&slot->command_lock);
    fork_destroy(&fork);
}

// ---- commands -----------------------------------------------------------------------------------

static bool check_session(struct sessions *s, int station, arthron_CommandReply *reply) {
    struct station_status status;
    station_slot_status(&s->slots[station], &status);
    return status.phase != SLOT_EMPTY ||
           reply_refuse_as(reply, arthron_Why_Code_NO_SESSION, station_name(s, station),
                           "station %s has no session", station_name(s, station));
}

// Who called an instructor has one.
static void note_command(struct sessions *s, const char *actor, const arthron_Command *command,
                         int station, arthron_CommandReply *reply) {
    if (remark_command(s, station, actor, &command->remark, reply))
        station_slot_set_help(&s->slots[station], 0);
}

// In an exam nobody helps.
static bool refuse_help(struct sessions *s, int station, const arthron_Command *command,
                        arthron_CommandReply *reply) {
    bool helps = command->kind == arthron_Command_Kind_UNDO ||
                 command->kind == arthron_Command_Kind_NOTE ||
                 command->kind == arthron_Command_Kind_HELP;
    if (!helps || !attempts_exam_runs(s, station))
        return false;
    reply_refuse_as(reply, arthron_Why_Code_EXAM_RUNS, NULL,
                    "station %s: an exam runs, with no notes, no markers, no undo and no help",
                    station_name(s, station));
    return true;
}

// Who trains does not intervene.
static bool intervenes(const arthron_Command *command) {
    switch (command->kind) {
    case arthron_Command_Kind_PAUSE:
    case arthron_Command_Kind_STOP:
    case arthron_Command_Kind_CASE:
    case arthron_Command_Kind_RESET:
    case arthron_Command_Kind_COPY:
    case arthron_Command_Kind_LEAVE:
        return !command->trainee[0];
    default:
        return false;
    }
}

static void command_session(struct sessions *s, const char *actor, const arthron_Command *command,
                            int station, arthron_CommandReply *reply) {
    // A trainee waits for no other's session, and meanwhile it may have become another's.
    if (!is_theirs(s, station, command->trainee, reply) || !check_session(s, station, reply) ||
        !course_open(s, station, reply) || !is_theirs(s, station, command->trainee, reply) ||
        refuse_help(s, station, command, reply))
        return;
    if (command->kind == arthron_Command_Kind_PAUSE)
        course_input(s, station, INPUT_PAUSE, SESSION_PAUSED, reply);
    else if (command->kind == arthron_Command_Kind_STOP)
        stop(s, station, command->trainee, reply);
    else if (command->kind == arthron_Command_Kind_UNDO)
        ask_for_undo(s, station, reply);
    else if (command->kind == arthron_Command_Kind_NOTE)
        note_command(s, actor, command, station, reply);
    else if (command->kind == arthron_Command_Kind_BEGIN)
        attempts_begin_command(s, station, command, reply);
    else if (command->kind == arthron_Command_Kind_LEAVE)
        attempts_leave_command(s, station, command, reply);
    else if (command->kind == arthron_Command_Kind_HELP)
        ask_for_help(s, station, reply);
    else
        course_input(s, station, INPUT_RESET, SESSION_RUNNING, reply);
}

static void command_station(struct sessions *s, const char *actor, const arthron_Command *command,
                            int station, arthron_CommandReply *reply) {
    pthread_mutex_lock(&s->slots[station].command_lock);
    if (command->kind == arthron_Command_Kind_START) {
        station_slot_set_stopped(&s->slots[station], false);
        if (course_open(s, station, reply))
            course_input(s, station, INPUT_START, SESSION_RUNNING, reply);
    } else if (command->kind == arthron_Command_Kind_CASE) {
        change_case(s, station, command, reply);
    } else if (command->kind == arthron_Command_Kind_ASSIGN) {
        assign(s, station, command->trainee, reply);
    } else if (command->kind == arthron_Command_Kind_TAKE) {
        take_station_command(s, station, command->trainee, reply);
    } else {
        command_session(s, actor, command, station, reply);
    }
    session_info(s, station, &reply->sessions[0]);
    reply->sessions_count = 1;
    pthread_mutex_unlock(&s->slots[station].command_lock);
}

static const char *command_name(arthron_Command_Kind kind) {
    static const char *const names[_arthron_Command_Kind_ARRAYSIZE] = {
        "list", "start", "pause",  "stop",  "case",  "reset", "show", "undo",
        "copy", "note",  "assign", "begin", "leave", "help",  "take"};
    return names[kind];
}

static void finish(struct sessions *s, const char *actor, const arthron_Command *command,
                   const arthron_CommandReply *reply) {
    const char *name = command_name(command->kind);
    if (reply->ok)
        audit_command(s, actor, name, command, &reply->sessions[0]);
    else if (command->kind == arthron_Command_Kind_UNDO)
        audit_command(s, actor, "undo refused", command, &reply->sessions[0]);
    log_info("sessions", "station %s: %s by %s: %s", command->station, name, actor,
             reply->ok ? "done" : reply->text);
}

void commands_run(struct sessions *s, const char *actor, const arthron_Command *command,
                  arthron_CommandReply *reply) {
    memset(reply, 0, sizeof *reply);
    if (command->kind == arthron_Command_Kind_LIST) {
        session_list_all(s, command->first, reply);
        return;
    }
    if (!command_name(command->kind)) {
        reply_refuse_as(reply, arthron_Why_Code_UNKNOWN_COMMAND, NULL,
                        "this server does not know that command");
        return;
    }
    int station = sessions_find_station(&s->config, command->station);
    bool by_trainee = command->kind != arthron_Command_Kind_ASSIGN && command->trainee[0];
    if (station < 0 && by_trainee) {
        refuse_trainee(command->station, reply);
        return;
    }
    if (station < 0) {
        reply_refuse_as(reply, arthron_Why_Code_NO_STATION, command->station,
                        "there is no station %s in the server's config", command->station);
        return;
    }
    if (command->kind == arthron_Command_Kind_SHOW) {
        session_list_one(s, station, reply);
        return;
    }
    if (!manager_opens(s)) {
        reply_refuse_as(reply, arthron_Why_Code_ENDING, NULL,
                        "the server is starting or ending: try again");
        return;
    }
    if (intervenes(command) && !attempts_intervene(s, station, command->reason, reply))
        return;
    if (command->kind == arthron_Command_Kind_COPY)
        copy_session(s, station, command, reply);
    else
        command_station(s, actor, command, station, reply);
    if (command->kind == arthron_Command_Kind_UNDO && reply->ok)
        wait_for_undo(s, station, reply);
    finish(s, actor, command, reply);
}
