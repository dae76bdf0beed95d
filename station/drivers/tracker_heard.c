#include "drivers/tracker_heard.h"

#include "base/clock.h"
#include "drivers/drivers.h"
#include "igtl/metadata.h"

#include <stdio.h>
#include <string.h>

static bool is_ambiguous(const struct tracker_tools *tools, const char *name) {
    int count = 0;
    for (int c = 0; c < CHANNEL_COUNT; c++)
        count += tools->names[c][0] && igtl_is_same_tool(tools->names[c], name);
    return count > 1;
}

bool tracker_tool_is(struct tracker_tools *tools, enum channel channel, const char *name) {
    const char *wanted = tools->names[channel];
    char *meant = tools->meant[channel];
    if (!wanted[0] || !igtl_is_same_tool(wanted, name))
        return false;
    if (strlen(name) == strlen(wanted))
        return true;
    if (strlen(name) < strlen(wanted))
        return !is_ambiguous(tools, name);
    if (!meant[0])
        strcpy(meant, name);
    return !strcmp(meant, name);
}

static const int64_t first_patience_ns = NS_PER_S / 2; // before any value came

static int64_t patience_ns(const struct tracker_heard *h) {
    if (!h->usual_ns)
        return first_patience_ns;
    return 2 * h->usual_ns > POLL_MAX_NS ? 2 * h->usual_ns : POLL_MAX_NS;
}

bool heard_is_silent(const struct tracker_heard *h, int64_t now_ns) {
    return now_ns - (h->value_ns ? h->value_ns : h->begin_ns) > patience_ns(h);
}

// A silence counts as the longest pause.
void heard_value(struct tracker_heard *h, int64_t now_ns) {
    int64_t passed_ns = now_ns - h->value_ns, longest_ns = patience_ns(h);
    if (h->usual_ns && passed_ns > longest_ns)
        passed_ns = longest_ns;
    if (h->value_ns)
        h->usual_ns += h->usual_ns ? (passed_ns - h->usual_ns) / 8 : passed_ns;
    h->value_ns = now_ns;
}

void heard_tool(struct tracker_heard *h, const char *name, int64_t now_ns) {
    int at = 0;
    h->other_ns = now_ns;
    while (at < h->count && strcmp(h->names[at], name))
        at++;
    if (at == HEARD_NAMES_MAX)
        return;
    h->count += at == h->count;
    strcpy(h->names[at], name);
}

void heard_message(struct tracker_heard *h, const char *type, int64_t now_ns) {
    h->other_ns = now_ns;
    strcpy(h->type, type);
}

void heard_names(const struct tracker_heard *h, char out[128]) {
    size_t used = 0;
    *out = 0;
    for (int i = 0; i < h->count && used < 128; i++)
        used += (size_t)snprintf(out + used, 128 - used, "%s%s", i ? ", " : "", h->names[i]);
    for (char *at = out; *at; at++)
        *at = *at >= ' ' && *at <= '~' ? *at : '?';
}

enum result heard_tell(const struct tracker_heard *h, int64_t now_ns, struct error *err) {
    char names[128];
    if (!h->other_ns || now_ns - h->other_ns > NS_PER_S)
        return RESULT_OK;
    heard_names(h, names);
    if (h->count)
        return fail(err, RESULT_TIMEOUT, "sends %s, and nothing that the config names", names);
    return fail(err, RESULT_TIMEOUT, "sends %s, and no pose", h->type);
}
