// TCP sockets by "host:port". All are non-blocking and closed on exec.
#pragma once

#include "base/result.h"

#include <stdint.h>

#define SOCKET_HOST_MAX 256
#define SOCKET_PORT_MAX 8

// "host:port", "[::1]:port". RESULT_INVALID where it is neither.
enum result socket_split(const char *address, char out_host[SOCKET_HOST_MAX],
                         char out_port[SOCKET_PORT_MAX], struct error *err);

// Connects within timeout_ms. A peer that vanishes without a word is noticed within a few seconds.
enum result socket_connect(const char *address, int timeout_ms, int *out_fd, struct error *err);

// Port 0 picks a free one; *out_port tells which one it is.
enum result socket_listen(const char *address, int *out_fd, uint16_t *out_port, struct error *err);
