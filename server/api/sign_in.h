// The end of each sign-in.
#pragma once

#include "api/call.h"

// Sets a cookie for the principal. RESULT_MISSING if the password or code has changed meanwhile, or
// somebody has signed the principal out: then the caller answers. After another error the request
// has been refused.
enum result sign_in_set_cookie(struct api_call *call);
