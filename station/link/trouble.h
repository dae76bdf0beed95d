// Why there is no connection, in whole sentences: what happened and what to do.
#pragma once

// For what libwebsockets says of a connection that failed (NULL: it could not even begin).
const char *trouble_sentence(const char *reason);
