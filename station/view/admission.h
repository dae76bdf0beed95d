// Which viewers are admitted, by their HTTP request. A page of another site reaches 127.0.0.1 too,
// by its address or by a name of its own that points there, so the name that was called and the
// page's origin are looked at besides the token.
#pragma once

#include "view/token.h"
#include "view/view.h"

// As the client sent them; empty: it did not.
struct admission_request {
    const char *path, *host, *origin, *subprotocol, *token;
};

// 0 if the viewer is admitted, else an HTTP status.
int admission_status(const struct view_config *config, const char token[TOKEN_LENGTH + 1],
                     const struct admission_request *request);
