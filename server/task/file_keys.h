// The keys of a task's file, ended by a NULL name: what a list of them has to hold.
#pragma once

#include "settings/settings.h"

const struct setting_key *task_goal_keys(void);
const struct setting_key *task_error_keys(void);
