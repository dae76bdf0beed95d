// A recorded session with two instruments and cuts, for what is made from records.
#pragma once

#include "replay/recording.h"

// As make_session, and records it: of station "bench 3", trainee "Anna Amsel", session a7a7...
int make_bites(void **state);
struct trace_header bites_header(void);
