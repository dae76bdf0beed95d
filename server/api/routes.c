#include "api/routes.h"

#include <string.h>

#define SLOW true
#define QUICK false

const struct route routes[] = {
#define ROUTE(...) {__VA_ARGS__},
#include "routes.inc"
#undef ROUTE
};

const int route_count = sizeof routes / sizeof *routes;

// Takes one part of a path. Returns its end, or NULL if the part is empty or too long.
static const char *take_path_part(const char *at, char out[STORE_NAME_MAX]) {
    size_t length = strcspn(at, "/");
    if (!length || length >= STORE_NAME_MAX)
        return NULL;
    memcpy(out, at, length);
    out[length] = '\0';
    return at + length;
}

static bool matches(const char *pattern, const char *path, char args[2][STORE_NAME_MAX]) {
    int count = 0;
    while (*pattern && path) {
        if (*pattern == '*') {
            path = take_path_part(path, args[count++]);
            pattern++;
        } else if (*pattern++ != *path++) {
            return false;
        }
    }
    return path && !*path;
}

const struct route *routes_find(const char *method, const char *path,
                                char out_args[2][STORE_NAME_MAX], bool *out_there) {
    size_t prefix = strlen(API_PREFIX);
    *out_there = false;
    if (strncmp(path, API_PREFIX, prefix))
        return NULL;
    for (int i = 0; i < route_count; i++) {
        if (!matches(routes[i].path, path + prefix, out_args))
            continue;
        if (!strcmp(routes[i].method, method))
            return &routes[i];
        *out_there = true;
    }
    return NULL;
}
