// Entries about sessions in the audit log of the records.
#pragma once

#include "sessions/parts.h"

// The server itself did this. session_id: 32 hexadecimal digits.
void audit_server(struct sessions *sessions, int station, const char *action,
                  const char *session_id);
// info: of the session after the command.
void audit_command(struct sessions *sessions, const char *actor, const char *action,
                   const arthron_Command *command, const arthron_SessionInfo *info);
