#include "runtime/slowed.h"

const char *slowed_text(enum slowed what) {
    static const char *const texts[SLOWED_COUNT] = {
        [SLOWED_FRAMES] = "the station sends more than its share of the server: frames are left "
                          "out. Lower its rate_hz, or cut less at once",
        [SLOWED_ASKS] = "the station asks for its meshes too often: they come later",
        [SLOWED_MESSAGES] = "the station sends too many messages: the server reads them later",
    };
    return texts[what];
}
