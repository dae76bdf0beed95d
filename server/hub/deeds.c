// Who did what to sessions, into the records' audit log.
#include "hub/seat.h"

#include <stdio.h>

static void id_text(const uint8_t id[16], char out[STORE_ID_MAX]) {
    for (int i = 0; i < 16; i++)
        snprintf(out + 2 * i, 3, "%02x", id[i]);
}

static void note(struct hub *hub, const char *actor, const char *action, const char *station,
                 const char *case_name, const char *session) {
    char subject[STORE_TEXT_MAX];
    snprintf(subject, sizeof subject, "station %s%s%s%s%s", station, *case_name ? " case " : "",
             case_name, *session ? " session " : "", session);
    recorder_note(hub->recorder, actor, action, subject);
}

void deed_of_server(struct hub *hub, const struct seat *seat, const char *action,
                    const uint8_t session_id[16]) {
    char id[STORE_ID_MAX];
    id_text(session_id, id);
    note(hub, "", action, seat->station->name, "", id);
}

void deed_of_command(struct hub *hub, const char *actor, const char *action,
                     const arthron_Command *command, const arthron_SessionInfo *info) {
    char id[STORE_ID_MAX] = "";
    // Of any other command nobody has looked at it.
    const char *case_name = command->kind == arthron_Command_Kind_CASE ? command->case_name : "";
    if (command->kind == arthron_Command_Kind_STOP || info->state != arthron_SessionState_CLOSED)
        id_text(info->id, id);
    note(hub, actor, action, command->station, case_name, id);
}
