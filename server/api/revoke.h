// Of several servers with one authority: each has a list of its own of the certificates that it
// issued, and of those that are revoked. So all of them are told.
#pragma once

#include "api/call.h"

// Once the station's certificates are revoked here; serials: of these, as authority_revoke_all
// tells them. It is answered later.
void revoke_elsewhere(struct api_call *call, const char *station, const char *serials);

// serials: empty: nobody ever issued a certificate to it. away: names of servers that could not be
// told, or empty.
void revoke_answer(struct web_response *response, const char *station, const char *serials,
                   const char *away);
