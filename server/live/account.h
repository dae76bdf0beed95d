// Who looks at a page.
#pragma once

#include <stdbool.h>

// Instructors see and command everything. Technicians see all stations, and may send the commands
// list and show. Trainees see their own sessions, and may begin and leave practice in them.
struct live_account {
    char name[64];
    char role[16]; // "instructor", "technician", "trainee"
    char trainee[64];
};

bool is_trainee(const struct live_account *account);
bool is_same_person(const struct live_account *a, const struct live_account *b);

// Gives `take` each account that must not learn a trainee's name now, and that name. False where the
// records do not say it: then nobody learns any. It may wait for the records.
typedef void take_blind(void *taker, const char *account, const char *trainee);
typedef bool each_blind(void *user, take_blind *take, void *taker);
