// Certificates for a station: its first one, and a new one for a station that has one.
#pragma once

#include "link/config.h"

#include <stdatomic.h>

// A new key, and from a server a certificate for it; both take the place of those in the config's
// keys_dir. Waits 15 s at most, or until *stopping is set (RESULT_CLOSED).
enum result enrol_again(const struct link_config *config, const struct server_address *server,
                        const atomic_bool *stopping, struct error *err);

// Asks the server at host:port for a certificate with a one-time code and writes the key files.
enum result link_enrol(const char *host, int port, const char *code, const char *station,
                       const char *keys_dir, struct error *err);
