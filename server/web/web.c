#include "web/web.h"

#include "base/check.h"

#include <stdlib.h>

struct web {
    struct web_handler handler;
    int port;
};

enum result web_create(const struct web_config *config, const struct web_handler *handler,
                       struct web **out_web, struct error *err) {
    (void)err;
    struct web *web = alloc(1, sizeof *web);
    web->handler = *handler;
    web->port = config->port;
    *out_web = web;
    return RESULT_OK;
}

int web_port(const struct web *web) {
    return web->port;
}

void web_destroy(struct web **web) {
    free(*web);
    *web = NULL;
}

void web_wake(struct web *web) {
    (void)web;
}
