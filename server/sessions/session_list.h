// Answers of the commands list and show.
#pragma once

#include "sessions/parts.h"

void session_info(struct sessions *sessions, int station, arthron_SessionInfo *out_info);
// As many as a reply has room for, from this station on.
void session_list_all(struct sessions *sessions, uint32_t first, arthron_CommandReply *reply);
// One station with its joint and its resections. Waits for a session that has just begun.
void session_list_one(struct sessions *sessions, int station, arthron_CommandReply *reply);
