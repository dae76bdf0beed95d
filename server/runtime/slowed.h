// What a station may only do so often, and what it is told when it does so too often.
#pragma once

enum slowed { SLOWED_FRAMES, SLOWED_ASKS, SLOWED_MESSAGES, SLOWED_COUNT };

// For the person at the station.
const char *slowed_text(enum slowed what);
