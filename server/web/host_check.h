// Checks the Host and Origin of requests. A page of another site can send requests through a
// visitor's browser, with the visitor's cookie (RFC 6265, 8.8). So a request that changes something
// must come from a page of the host that it is sent to. That host must be a name of this server,
// and not another name that resolves to it.
#pragma once

#include "base/result.h"

#include <stdbool.h>
#include <stddef.h>

struct host_check;

// names: other names of the server, NULL behind the last. certificate_path NULL: the server has no
// TLS, and no name but those of this machine for itself. RESULT_MISSING or RESULT_FORMAT name the
// file of the certificate.
enum result host_check_create(const char *certificate_path, const char *const *names,
                              struct host_check **out_check, struct error *err);
// Reads the file of the certificate again, and keeps the old one if it cannot be read.
void host_check_renew(struct host_check *hosts);
void host_check_destroy(struct host_check **hosts); // NULL inside is fine; *hosts becomes NULL

// host: as in the header of that name, with or without a port.
bool host_check_is_own(const struct host_check *hosts, const char *host);

// The name for links: `name` if it is the server's own, else the first name of the certificate,
// else localhost. size: of out_name, above 0.
void host_check_public_name(const struct host_check *hosts, const char *name, char *out_name,
                            size_t size);

// Whether `origin` is this host over HTTPS, or over HTTP where the server has no TLS.
bool host_check_is_origin(const struct host_check *hosts, const char *origin, const char *host);
