// What monitors ask for.
#include "api/routes.h"
#include "base/check.h"

#include <stdio.h>
#include <string.h>

static enum result write_figures(void *user, FILE *file, struct error *err) {
    const struct api_call *call = user;
    const struct api_config *config = &call->api->config;
    (void)err;
    config->write_figures(config->watch_user, call->request->takes_openmetrics, file);
    return RESULT_OK;
}

void get_metrics(struct api_call *call) {
    struct web_response *r = call->response;
    struct error err = {""};
    call_close_store(call);
    if (!call_check(call, call_fill(call, write_figures, call, &err), &err))
        return;
    snprintf(r->type, sizeof r->type, "%s; charset=utf-8",
             call->request->takes_openmetrics ? "application/openmetrics-text; version=1.0.0"
                                              : "text/plain; version=0.0.4");
    r->compress = true;
}

static void answer_line(struct api_call *call, bool (*asks)(void *, char[API_WHY_MAX])) {
    struct web_response *r = call->response;
    char why[API_WHY_MAX] = "ok";
    bool good = asks(call->api->config.watch_user, why);
    r->status = good ? 200 : 503;
    r->size = strlen(why) + 1;
    r->body = alloc(r->size + 1, 1);
    snprintf(r->body, r->size + 1, "%s\n", why);
    snprintf(r->type, sizeof r->type, "text/plain; charset=utf-8");
}

void get_healthz(struct api_call *call) {
    answer_line(call, call->api->config.lives);
}

void get_readyz(struct api_call *call) {
    answer_line(call, call->api->config.is_ready);
}
