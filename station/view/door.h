// Who may look: what a viewer's HTTP request must be. A page of another site reaches 127.0.0.1 too,
// by its address or by a name of its own that points there, so the name that was called and the
// page's origin are looked at besides the token.
#pragma once

#include "view/token.h"
#include "view/view.h"

// As the client sent them; empty: it did not.
struct door_request {
    const char *path, *host, *origin, *subprotocol, *token;
};

// An HTTP status: 0 where it is let in.
int door_judge(const struct view_config *config, const char token[TOKEN_LENGTH + 1],
               const struct door_request *request);
