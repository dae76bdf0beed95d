// The reason why a program cannot listen at a port, in words for its user.
#pragma once

#include "base/result.h"

// Tries a TCP port of this machine and releases it. RESULT_OK if a program could listen there, or
// if that cannot be known. An address of NULL means all.
enum result listen_check(const char *address, int port, struct error *err);

// For a bind that failed with the errno `reason`: "UDP port 4811 is in use".
enum result listen_failed(const char *protocol, const char *address, int port, int reason,
                          struct error *err);
