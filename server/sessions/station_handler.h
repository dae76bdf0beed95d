// What stations say over their control connections. All of it runs in the control thread, which
// waits for nothing.
#pragma once

#include "sessions/parts.h"

struct control_handler station_handler(struct sessions *sessions);
