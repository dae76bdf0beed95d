// Messages as they should be, filled as far as they go, for tests to send and to spoil.
#pragma once

#include "random.h"
#include "wire/wire.h"

struct sample make_sample(struct random *random, enum channel channel);
struct frame make_frame(struct random *random, int count);
struct avatar_extrapolation make_extrapolation(enum avatar_mode mode);

// The longest that a server sends for these instruments, and the longest of all.
arthron_Reply longest_reply(const bool there[CHANNEL_COUNT]);
arthron_Reply full_reply(void);
void make_knee(struct knee_frame *out);

// which: the message's tag, arthron_Control_hello_tag and so on.
void fill_control(int which, arthron_Control *out);
void fill_console(int which, arthron_Console *out);
