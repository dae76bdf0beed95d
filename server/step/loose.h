// Loose bodies of a session: rigid ellipsoids of the patient that lie on bones and menisci, are
// pushed by instruments, held by a grasper and carried out through a portal. They have neither
// weight nor speed: what nothing touches rests, and what nothing holds goes to the nearest surface.
// For session.c only.
#pragma once

#include "base/kept.h"
#include "step/output.h"
#include "step/settings.h"

// What they lie on, of one case: bones and menisci as the patient has them, before any cut.
struct loose_ground;

// *out_ground is NULL where the case has no loose bodies. RESULT_INVALID: one of them lies farther
// than LOOSE_AWAY_MM from all of its body's surfaces. RESULT_IO: Embree cannot build.
#define LOOSE_AWAY_MM 10.0
enum result loose_ground_create(const struct knee_case *knee, struct loose_ground **out_ground,
                                struct error *err);
void loose_ground_destroy(struct loose_ground **ground); // NULL inside is fine

// The loose bodies of one session. The knee and the ground must outlive it. NULL without a ground.
struct loose;

struct loose *loose_create(const struct knee_case *knee, const struct loose_ground *ground);
void loose_destroy(struct loose **loose);        // NULL inside is fine
void loose_reset(struct loose *loose);           // back to their first places
bool loose_has_moved(const struct loose *loose); // one is not at its first place

// Keeps them, or reads them into new ones of the same knee.
void loose_keep(struct loose *loose, struct kept *kept);

// How an open jaw comes to hold and to let go, by its opening from 0 to 1: it holds what lies
// between its jaws as it closes below the first, and lets go above the second.
#define LOOSE_HELD_OPENING 0.5
#define LOOSE_LET_GO_OPENING 0.6

struct loose_tools {
    const struct instruments *instruments;
    const struct instrument_body *bodies;
    const int *portals; // that each goes through: index in the case, -1: none
};

// Fills in the output's loose bodies from its bones and its instruments as they are shown, and
// returns the events. `running`: else they only go with what carries them. passed_ns: since the
// step before. cut: a bit for each group that was cut, on which nothing lies any more.
uint32_t loose_step(struct loose *loose, const struct loose_tools *tools, bool running,
                    int64_t passed_ns, uint32_t cut, struct session_output *out);
