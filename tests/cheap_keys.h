// Keys from passphrases without their costs, for a test that is linked with
// --wrap=argon2id_hash_raw. Costs without bounds fail a CHECK.
#pragma once

#include <stdbool.h>

extern bool keys_cost_all; // false: as little as there can be
