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
