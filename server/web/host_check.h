// Which hosts this server is, and which pages may speak to it. A page of another site reaches the
// server too, through the browser of whoever visits that site, with their cookie (RFC 6265, 8.8):
// so what changes something must come from a page of the very host that was called, and that host
// must be one of ours, not a stranger's name that points here.
#pragma once

#include "base/result.h"

#include <stdbool.h>
#include <stddef.h>

struct host_check;

// names: what the server is called besides, NULL behind the last. RESULT_MISSING or RESULT_FORMAT
// name the certificate's file.
enum result host_check_create(const char *certificate_path, const char *const *names,
                              struct host_check **out_check, struct error *err);
void host_check_renew(
    struct host_check *hosts); // its certificate's file is another one; where it can be read
void host_check_destroy(struct host_check **hosts); // NULL inside is fine; *hosts becomes NULL

// host: as in the header of that name, with or without a port.
bool host_check_is_own(const struct host_check *hosts, const char *host);

// What browsers reach it as: `name` where it is its own, else the first name of its certificate,
// else localhost. size: of out_name, above 0.
void host_check_public_name(const struct host_check *hosts, const char *name, char *out_name,
                            size_t size);

// Whether `origin` is the page that the host itself serves.
bool host_check_is_origin(const char *origin, const char *host);
