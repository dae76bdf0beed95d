#include "sessions/audit.h"

#include <stdio.h>

static void note_action(struct sessions *s, const char *actor, const char *action,
                        const char *station, const char *case_name, const char *session) {
    char subject[STORE_TEXT_MAX];
    snprintf(subject, sizeof subject, "station %s%s%s%s%s", station, *case_name ? " case " : "",
             case_name, *session ? " session " : "", session);
    recorder_note(s->recorder, actor, action, subject);
}

void audit_server(struct sessions *s, int station, const char *action, const char *session_id) {
    note_action(s, "", action, station_name(s, station), "", session_id);
}

void audit_command(struct sessions *s, const char *actor, const char *action,
                   const arthron_Command *command, const arthron_SessionInfo *info) {
    char id[STORE_ID_MAX] = "";
    // Nothing checked the case name of another command.
    const char *case_name = command->kind == arthron_Command_Kind_CASE ? command->case_name : "";
    if (command->kind == arthron_Command_Kind_STOP || info->state != arthron_SessionState_CLOSED)
        for (int i = 0; i < 16; i++)
            snprintf(id + 2 * i, 3, "%02x", info->id[i]);
    note_action(s, actor, action, command->station, case_name, id);
}
