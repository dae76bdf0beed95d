#include "net/console_parts.h"

#include <pwd.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/un.h>

bool console_collect(struct exchange *x, struct lws *socket, const void *bytes, size_t size,
                     bool *out_whole) {
    if (size > sizeof x->in - x->in_size)
        return false;
    memcpy(x->in + x->in_size, bytes, size);
    x->in_size += size;
    *out_whole = !lws_remaining_packet_payload(socket) && lws_is_final_fragment(socket);
    return true;
}

int console_write(struct exchange *x, struct lws *socket) {
    size_t size = x->out_size;
    x->out_size = 0;
    return size && lws_write(socket, x->out, size, LWS_WRITE_BINARY) < (int)size ? -1 : 0;
}

enum result console_check_length(const char *path, struct error *err) {
    size_t longest = sizeof((struct sockaddr_un *)0)->sun_path - 1;
    if (strlen(path) > longest)
        return fail(err, RESULT_LIMIT, "%s: a socket's path has at most %zu characters", path,
                    longest);
    return RESULT_OK;
}

enum result console_refuse_user(const char *path, struct error *err) {
    struct stat status;
    const struct passwd *owner = lstat(path, &status) ? NULL : getpwuid(status.st_uid);
    if (!owner)
        return fail(err, RESULT_REFUSED, "%s: permission denied", path);
    return fail(err, RESULT_REFUSED,
                "%s: permission denied; run this as the user %s (runuser -u %s -- ...)", path,
                owner->pw_name, owner->pw_name);
}

bool console_is_long(arthron_Command_Kind kind) {
    return kind == arthron_Command_Kind_UNDO || kind == arthron_Command_Kind_COPY;
}
