// The inside of a link: a new certificate for a station that has one.
#pragma once

#include "link/link.h"

#include <stdatomic.h>

// A new key, and from the server of `config` a certificate for it; both take the place of those in
// its keys_dir. Waits 15 s at most, or until *stopping is set (RESULT_CLOSED).
enum result enrol_again(const struct link_config *config, const atomic_bool *stopping,
                        struct error *err);
