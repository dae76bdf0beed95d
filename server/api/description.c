// The description of /api/v1, for programs that are made of it.
#include "api/routes.h"
#include "base/check.h"

#include <string.h>

extern const char api_description[]; // made by describe.py

void get_openapi(struct api_call *call) {
    struct web_response *r = call->response;
    r->status = 200;
    r->body = alloc_text(api_description);
    r->size = strlen(r->body);
    r->compress = true;
}
