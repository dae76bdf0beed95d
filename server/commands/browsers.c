#include "commands/browsers.h"

#include "api/api.h"
#include "base/check.h"
#include "base/log.h"
#include "review/page.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define LINK_MAX 320

struct browsers {
    struct api_case cases[HUB_CASES_MAX];
    struct api_station stations[HUB_STATIONS_MAX];
    char link[LINK_MAX];
    struct api *api;
    struct web *web;
};

// ---- what the web room asks ---------------------------------------------------------------------

static void on_request(void *user, const struct web_request *request, struct web_response *out) {
    api_answer(((struct browsers *)user)->api, request, out);
}

static bool on_enter(void *user, const char *token, struct web_account *out_account) {
    return api_enter(((struct browsers *)user)->api, token, out_account);
}

static void *on_viewer(void *user, const struct web_account *account) {
    (void)user, (void)account;
    return NULL;
}

// ---- joining ------------------------------------------------------------------------------------

static enum result write_report(const char *trace, FILE *file, struct error *err) {
    const struct review_source source = {.trace = trace};
    bool whole;
    return review_write_page(&source, file, &whole, err);
}

// What a browser calls the server: its first name, else its address, else the machine's name.
static void make_link(const struct web_settings *web, char out[LINK_MAX]) {
    char host[256] = "localhost";
    if (web->names[0][0])
        snprintf(host, sizeof host, "%s", web->names[0]);
    else if (web->address[0] && strcmp(web->address, "0.0.0.0") && strcmp(web->address, "::"))
        snprintf(host, sizeof host, strchr(web->address, ':') ? "[%s]" : "%s", web->address);
    else
        gethostname(host, sizeof host - 1);
    snprintf(out, LINK_MAX, "https://%s:%d/", host, web->port);
}

static enum result open_api(struct browsers *b, const struct hub_config *hub, struct error *err) {
    for (int i = 0; i < hub->case_count; i++)
        b->cases[i] = (struct api_case){hub->cases[i].name, hub->cases[i].dir};
    for (int i = 0; i < hub->station_count; i++) {
        const struct hub_station *station = &hub->stations[i];
        b->stations[i] = (struct api_station){station->name, station->case_name, station->trainee,
                                              station->start_by_command};
    }
    const struct api_config config = {
        .records = hub->records,
        .keys_dir = hub->keys_dir,
        .link = b->link,
        .cases = b->cases,
        .case_count = hub->case_count,
        .stations = b->stations,
        .station_count = hub->station_count,
        .report = write_report,
    };
    return api_create(&config, &b->api, err);
}

static enum result open_web(struct browsers *b, const struct web_settings *settings,
                            struct error *err) {
    const struct web_handler handler = {
        .user = b,
        .on_request = on_request,
        .on_enter = on_enter,
        .on_viewer = on_viewer,
    };
    struct web_config config = {
        .address = settings->address[0] ? settings->address : NULL,
        .port = settings->port,
        .certificate = settings->certificate,
        .key = settings->key,
        .pages = web_pages_built_in,
    };
    for (int i = 0; i < SERVER_NAMES_MAX && settings->names[i][0]; i++)
        config.names[i] = settings->names[i];
    return web_create(&config, &handler, &b->web, err);
}

enum result browsers_create(const struct server_config *config, struct browsers **out_browsers,
                            struct error *err) {
    struct browsers *b = alloc(1, sizeof *b);
    make_link(&config->web, b->link);
    enum result result = open_api(b, &config->hub, err);
    if (result == RESULT_OK)
        result = open_web(b, &config->web, err);
    if (result == RESULT_OK)
        log_info("server", "browsers are served at %s", b->link);
    else
        browsers_destroy(&b);
    *out_browsers = b;
    return result;
}

void browsers_destroy(struct browsers **browsers) {
    struct browsers *b = *browsers;
    if (!b)
        return;
    if (b->web)
        web_destroy(&b->web);
    api_destroy(&b->api);
    free(b);
    *browsers = NULL;
}
