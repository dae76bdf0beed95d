// What instructors ask for: at the server's socket, and on its pages.
#include "base/clock.h"
#include "base/log.h"
#include "hub/copied.h"
#include "hub/grades.h"
#include "hub/reply.h"
#include "store/text.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#define STATE_WAIT_MS 500
#define UNDO_WAIT_MS 60000

// ---- a session's course -------------------------------------------------------------------------

// desk_lock held. What is told is counted, and by the worker what it has done.
static bool tell_input(struct hub *hub, int index, enum input_kind kind) {
    struct worker *worker = seat_worker(hub, index);
    struct note note = {.kind = NOTE_INPUT, .seat = index, .input = kind};
    bool told = worker_tell(worker, worker->from_desk, &note);
    hub->seats[index].inputs_told += told;
    return told;
}

// All inputs are taken, and led to that.
static bool wait_for_state(struct seat *seat, enum session_state state) {
    const struct timespec pause = {0, 5 * NS_PER_MS};
    for (int waited = 0; waited < STATE_WAIT_MS; waited += 5) {
        if (atomic_load(&seat->counts.inputs) == seat->inputs_told)
            return atomic_load(&seat->counts.state) == (int)state;
        nanosleep(&pause, NULL);
    }
    return false;
}

static void give_input(struct hub *hub, int index, enum input_kind kind,
                       enum session_state expected, arthron_CommandReply *reply) {
    if (!tell_input(hub, index, kind))
        reply_refuse(reply, "station %s: its worker is too busy", hub->seats[index].station->name);
    else if (!wait_for_state(&hub->seats[index], expected))
        reply_refuse(reply, "station %s: the session stayed as it was",
                     hub->seats[index].station->name);
    else
        reply->ok = true;
}

// False where one is on its way, whose answer would be taken for that of the next.
static bool begin_undo(struct hub *hub, struct seat *seat) {
    struct card *card = &seat->card;
    pthread_mutex_lock(&hub->card_lock);
    bool pending =
        card->undo_of == card->about.session && atomic_load(&seat->counts.undo) == UNDO_ASKED;
    bool free = !card->undo_awaited && !pending;
    if (free) {
        card->undone = (arthron_Undone){0};
        card->undo_of = card->about.session;
        card->undo_awaited = true;
        atomic_store(&seat->counts.undo, UNDO_ASKED);
    }
    pthread_mutex_unlock(&hub->card_lock);
    return free;
}

static arthron_Undone end_undo(struct hub *hub, struct seat *seat) {
    pthread_mutex_lock(&hub->card_lock);
    arthron_Undone undone = seat->card.undone;
    seat->card.undo_awaited = false;
    pthread_mutex_unlock(&hub->card_lock);
    return undone;
}

static bool can_be_cut(struct hub *hub, const struct seat *seat) {
    pthread_mutex_lock(&hub->card_lock);
    int scene = seat->card.about.scene;
    pthread_mutex_unlock(&hub->card_lock);
    return scene_tissue_count(hub->scenes[scene]) > 0;
}

static void refuse_nothing_to_undo(const struct seat *seat, arthron_CommandReply *reply) {
    reply_refuse(reply, "station %s: there is no cut to be undone", seat->station->name);
}

static void ask_for_undo(struct hub *hub, int index, arthron_CommandReply *reply) {
    struct seat *seat = &hub->seats[index];
    if (!can_be_cut(hub, seat)) { // no theatre would answer
        refuse_nothing_to_undo(seat, reply);
        return;
    }
    if (!begin_undo(hub, seat)) {
        reply_refuse(reply, "station %s: an undo is on its way", seat->station->name);
        return;
    }
    reply->ok = tell_input(hub, index, INPUT_UNDO);
    if (reply->ok)
        return;
    atomic_store(&seat->counts.undo, JOB_NOTHING);
    end_undo(hub, seat);
    reply_refuse(reply, "station %s: its worker is too busy", seat->station->name);
}

static bool undo_may_come(struct hub *hub, struct seat *seat) {
    pthread_mutex_lock(&hub->card_lock);
    bool same = seat->card.about.session == seat->card.undo_of;
    pthread_mutex_unlock(&hub->card_lock);
    return same && seat_has_session(seat);
}

// Without the desk's lock: no other station waits for a theatre.
static void wait_for_undo(struct hub *hub, int index, arthron_CommandReply *reply) {
    struct seat *seat = &hub->seats[index];
    const struct timespec pause = {0, 5 * NS_PER_MS};
    int outcome = UNDO_ASKED;
    for (int waited = 0; outcome == UNDO_ASKED && waited < UNDO_WAIT_MS; waited += 5) {
        bool lives = undo_may_come(hub, seat);
        outcome = atomic_load(&seat->counts.undo);
        if (!lives || atomic_load(&hub->ending))
            break;
        nanosleep(&pause, NULL);
    }
    if (outcome == JOB_NOTHING)
        refuse_nothing_to_undo(seat, reply);
    else if (outcome == UNDO_ASKED && atomic_load(&hub->ending))
        reply_refuse(reply, "station %s: the server ends", seat->station->name);
    else if (outcome == UNDO_ASKED)
        reply_refuse(reply, "station %s: its session ended, or is too busy to undo a cut in %d s",
                     seat->station->name, UNDO_WAIT_MS / 1000);
    reply->undone = end_undo(hub, seat);
    reply->has_undone = reply->ok;
}

static bool is_connected(struct hub *hub, int index) {
    pthread_mutex_lock(&hub->card_lock);
    bool connected = hub->seats[index].card.connected;
    pthread_mutex_unlock(&hub->card_lock);
    return connected;
}

// A new session where there is none. False: the reply says why not.
static bool have_session(struct hub *hub, int index, arthron_CommandReply *reply) {
    struct error err;
    if (seat_has_session(&hub->seats[index]))
        return true;
    if (!is_connected(hub, index)) {
        reply_refuse(reply, "station %s is not connected", hub->seats[index].station->name);
        return false;
    }
    if (desk_open(hub, index, &err) == RESULT_OK)
        return true;
    reply_refuse(reply, "%s", err.text);
    return false;
}

static void stop(struct hub *hub, int index, arthron_CommandReply *reply) {
    pthread_mutex_lock(&hub->card_lock);
    hub->seats[index].card.stopped = true;
    pthread_mutex_unlock(&hub->card_lock);
    give_input(hub, index, INPUT_STOP, SESSION_CLOSED, reply);
}

// ---- which session it is --------------------------------------------------------------------

// A station that is away meets the new case when it comes.
static void change_case(struct hub *hub, int index, const arthron_Command *command,
                        arthron_CommandReply *reply) {
    int scene = hub_find_case(&hub->config, command->case_name);
    if (scene < 0) {
        reply_refuse(reply, "there is no case %s", command->case_name);
        return;
    }
    if (command->has_strength && !(command->strength >= 0 && command->strength <= 1)) {
        reply_refuse(reply, "the strength of a warp is from 0 to 1");
        return;
    }
    struct error unfit;
    grades_refresh(hub->grades);
    if (grades_allow(hub->grades, scene, &unfit) != RESULT_OK) {
        reply_refuse(reply, "%s", unfit.text);
        return;
    }
    reply->ok = true;
    if (seat_has_session(&hub->seats[index]))
        stop(hub, index, reply);
    if (!reply->ok)
        return;
    pthread_mutex_lock(&hub->card_lock);
    hub->seats[index].card.scene = scene;
    hub->seats[index].card.strength = command->has_strength ? command->strength : NAN;
    desk_clear_figures(&hub->seats[index].card);
    pthread_mutex_unlock(&hub->card_lock);
    if (is_connected(hub, index))
        have_session(hub, index, reply);
}

static void assign(struct hub *hub, int index, const char *trainee, arthron_CommandReply *reply) {
    struct card *card = &hub->seats[index].card;
    struct error err;
    if (trainee[0] && // nobody; and else a name that the records take
        text_check(trainee, "trainee's name", STORE_NAME_MAX, &err) != RESULT_OK) {
        reply_refuse(reply, "%s", err.text);
        return;
    }
    pthread_mutex_lock(&hub->card_lock);
    snprintf(card->trainee, sizeof card->trainee, "%s", trainee);
    pthread_mutex_unlock(&hub->card_lock);
    reply->ok = true;
}

// desk_lock held. The session is made, and takes the place of that which the station has.
static void take_copied(struct hub *hub, int index, struct copied *copied,
                        arthron_CommandReply *reply) {
    struct card *card = &hub->seats[index].card;
    struct live *live = copied->again.live;
    struct error err;
    reply->ok = true;
    if (seat_has_session(&hub->seats[index]))
        stop(hub, index, reply);
    if (!reply->ok)
        return;
    if (copied_begin(copied, &err) != RESULT_OK) {
        reply_refuse(reply, "%s", err.text);
        return;
    }
    copied->again.live = NULL;
    pthread_mutex_lock(&hub->card_lock);
    memcpy(card->session_id, copied->header.session_id, sizeof card->session_id);
    card->id_is_fresh = card->stopped = false;
    card->scene = copied->again.scene;
    pthread_mutex_unlock(&hub->card_lock);
    desk_announce(hub, index, live, &copied->header, copied->path);
    desk_attach(hub, index, live);
}

// What takes long comes first, while no other station waits for the desk.
static void copy_session(struct hub *hub, int index, const arthron_Command *command,
                         arthron_CommandReply *reply) {
    struct copied *copied;
    struct error err;
    if (!(command->at_s >= 0)) {
        reply_refuse(reply, "%g s: a session is copied at its end or at a time after its start",
                     command->at_s);
        return;
    }
    double at_s = command->at_s > 0 ? command->at_s : INFINITY;
    if (copied_create(hub, index, command->from, at_s, &copied, &err) != RESULT_OK) {
        reply_refuse(reply, "%s", err.text);
        return;
    }
    pthread_mutex_lock(&hub->desk_lock);
    desk_put_in_order(hub);
    take_copied(hub, index, copied, reply);
    seat_info(hub, index, &reply->sessions[0]);
    reply->sessions_count = 1;
    pthread_mutex_unlock(&hub->desk_lock);
    copied_destroy(&copied);
}

// ---- commands -----------------------------------------------------------------------------------

static void command_station(struct hub *hub, const char *actor, const arthron_Command *command,
                            int index, arthron_CommandReply *reply) {
    if (command->kind == arthron_Command_Kind_START) {
        if (have_session(hub, index, reply))
            give_input(hub, index, INPUT_START, SESSION_RUNNING, reply);
    } else if (command->kind == arthron_Command_Kind_CASE) {
        change_case(hub, index, command, reply);
    } else if (command->kind == arthron_Command_Kind_ASSIGN) {
        assign(hub, index, command->trainee, reply);
    } else if (!seat_has_session(&hub->seats[index])) {
        reply_refuse(reply, "station %s has no session", command->station);
    } else if (command->kind == arthron_Command_Kind_PAUSE) {
        give_input(hub, index, INPUT_PAUSE, SESSION_PAUSED, reply);
    } else if (command->kind == arthron_Command_Kind_STOP) {
        stop(hub, index, reply);
    } else if (command->kind == arthron_Command_Kind_UNDO) {
        ask_for_undo(hub, index, reply);
    } else if (command->kind == arthron_Command_Kind_NOTE) {
        reply->ok = remarks_command(hub, index, actor, &command->remark, reply);
    } else {
        give_input(hub, index, INPUT_RESET, SESSION_RUNNING, reply);
        int asked = UNDO_ASKED; // what was asked for before will not be
        atomic_compare_exchange_strong(&hub->seats[index].counts.undo, &asked, JOB_NOTHING);
    }
    seat_info(hub, index, &reply->sessions[0]);
    reply->sessions_count = 1;
}

static const char *command_name(arthron_Command_Kind kind) {
    static const char *const names[_arthron_Command_Kind_ARRAYSIZE] = {
        "list", "start", "pause", "stop", "case",  "reset",
        "show", "undo",  "copy",  "note", "assign"};
    return names[kind];
}

void desk_command(void *user, const char *actor, const arthron_Command *command,
                  arthron_CommandReply *reply) {
    struct hub *hub = user;
    memset(reply, 0, sizeof *reply);
    if (command->kind == arthron_Command_Kind_LIST) {
        listing_all(hub, reply);
        return;
    }
    if (!command_name(command->kind)) {
        reply_refuse(reply, "this server does not know that command");
        return;
    }
    int index = hub_find_station(&hub->config, command->station);
    if (index < 0) {
        reply_refuse(reply, "there is no station %s in the server's config", command->station);
        return;
    }
    if (command->kind == arthron_Command_Kind_SHOW) {
        listing_seat(hub, index, reply);
        return;
    }
    if (command->kind == arthron_Command_Kind_COPY) {
        copy_session(hub, index, command, reply);
    } else {
        pthread_mutex_lock(&hub->desk_lock);
        desk_put_in_order(hub);
        command_station(hub, actor, command, index, reply);
        pthread_mutex_unlock(&hub->desk_lock);
    }
    if (command->kind == arthron_Command_Kind_UNDO && reply->ok)
        wait_for_undo(hub, index, reply);
    if (reply->ok)
        deed_of_command(hub, actor, command_name(command->kind), command, &reply->sessions[0]);
    else if (command->kind == arthron_Command_Kind_UNDO)
        deed_of_command(hub, actor, "undo refused", command, &reply->sessions[0]);
    log_info("hub", "station %s: %s by %s: %s", command->station, command_name(command->kind),
             actor, reply->ok ? "done" : reply->text);
}
