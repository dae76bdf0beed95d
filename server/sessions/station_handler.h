// Handles the messages of stations. It runs in the control thread, so it waits for nothing.
#pragma once

#include "sessions/parts.h"

struct control_handler station_handler(struct sessions *sessions);
