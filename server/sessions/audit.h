// Who did what to sessions, into the audit log of the records.
#pragma once

#include "sessions/parts.h"

// By the server itself. session_id: 32 hexadecimal digits.
void audit_server(struct sessions *sessions, int station, const char *action,
                  const char *session_id);
// info: as the command left the session.
void audit_command(struct sessions *sessions, const char *actor, const char *action,
                   const arthron_Command *command, const arthron_SessionInfo *info);
