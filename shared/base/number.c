#include "base/number.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

bool number_int(const char *text, int64_t low, int64_t high, int64_t *out) {
    char *end;
    errno = 0;
    long long value = strtoll(text, &end, 10);
    if (end == text || *end || errno || value < low || value > high)
        return false;
    *out = value;
    return true;
}

bool number_double(const char *text, double low, double high, double *out) {
    char *end;
    double value = strtod(text, &end);
    if (end == text || *end || !(value >= low && value <= high))
        return false;
    *out = value;
    return true;
}

bool number_bool(const char *text, bool *out) {
    static const char *const words[] = {"no", "yes", "false", "true", "off", "on", "0", "1"};
    for (int i = 0; i < 8; i++)
        if (!strcasecmp(text, words[i])) {
            *out = i % 2;
            return true;
        }
    return false;
}

int number_list(const char *text, int most, double *out) {
    int count = 0;
    for (;;) {
        text += strspn(text, " \t,");
        if (!*text)
            return count;
        char *end;
        double value = strtod(text, &end);
        if (end == text || count == most || !isfinite(value) || (*end && !strchr(" \t,", *end)))
            return -1;
        out[count++] = value;
        text = end;
    }
}

bool number_pose(const char *text, pose *out) {
    double n[7] = {0, 0, 0, 1, 0, 0, 0};
    int count = number_list(text, 7, n);
    pose p = {{n[3], n[4], n[5], n[6]}, {n[0], n[1], n[2]}};
    if ((count != 3 && count != 7) || !pose_is_valid(p))
        return false;
    p.rotation = quat_unit(p.rotation);
    *out = p;
    return true;
}
