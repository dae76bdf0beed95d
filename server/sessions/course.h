// The course of a session under commands: opened, given inputs, stopped. The caller holds the
// command lock of the slot.
#pragma once

#include "sessions/parts.h"

// Gives the input and waits until it led to `expected`. False: the reply says why not.
bool course_input(struct sessions *sessions, int station, enum input_kind kind,
                  enum session_state expected, arthron_CommandReply *reply);

// Opens a session where there is none. False: the reply says why not.
bool course_open(struct sessions *sessions, int station, arthron_CommandReply *reply);

// Ends the session, if there is one; no other begins by itself. Then runtime_tissues reports on its
// last cut, unless the cut worker is too busy for 5 s.
bool course_stop(struct sessions *sessions, int station, arthron_CommandReply *reply);
