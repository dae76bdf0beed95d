#include "drivers/force.h"

#include "base/number.h"
#include "drivers/options.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

int force_split(const char *text, char out_parts[FORCE_PARTS_MAX][FORCE_TEXT_MAX]) {
    int count = 0;
    for (;; text++) {
        text += strspn(text, " \t");
        size_t length = strcspn(text, ",");
        const char *next = text + length;
        while (length && strchr(" \t", text[length - 1]))
            length--;
        if (!length || length >= FORCE_TEXT_MAX || count == FORCE_PARTS_MAX)
            return 0;
        memcpy(out_parts[count], text, length);
        out_parts[count++][length] = '\0';
        text = next;
        if (!*text)
            return count == 1 || count == FORCE_PARTS_MAX ? count : 0;
    }
}

enum result force_read_zero(const struct device_config *config, enum channel channel,
                            struct force *force, struct error *err) {
    char key[64];
    snprintf(key, sizeof key, "zero.%s", channel_name(channel));
    const char *text = option_text(config, key);
    memset(force->zero_n, 0, sizeof force->zero_n);
    if (!text)
        return RESULT_OK;
    if (!force->count)
        return option_fail(config, key, err, RESULT_INVALID, "the section has no force of it");
    if (number_list(text, force->count, force->zero_n) != force->count)
        return option_fail(config, key, err, RESULT_INVALID, "\"%s\" is not %s", text,
                           force->count == 1 ? "a number of newtons" : "three numbers of newtons");
    return RESULT_OK;
}

double force_of(const struct force *force, const double parts_n[FORCE_PARTS_MAX]) {
    double sum = 0;
    if (force->count == 1)
        return parts_n[0] - force->zero_n[0];
    for (int i = 0; i < force->count; i++) {
        double n = parts_n[i] - force->zero_n[i];
        sum += n * n;
    }
    return sqrt(sum);
}
