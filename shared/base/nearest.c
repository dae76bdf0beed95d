#include "base/nearest.h"

#include <ctype.h>
#include <stdbool.h>
#include <string.h>

#define LETTERS_MAX 48

static int lowest(int a, int b) {
    return a < b ? a : b;
}

static bool same_letter(char a, char b) {
    return tolower((unsigned char)a) == tolower((unsigned char)b);
}

// Damerau and Levenshtein, restricted: a pair of letters is swapped at most once.
static int distance(const char *a, const char *b) {
    int rows = (int)strlen(a), columns = (int)strlen(b);
    int d[LETTERS_MAX + 1][LETTERS_MAX + 1];
    if (rows > LETTERS_MAX || columns > LETTERS_MAX)
        return LETTERS_MAX;
    for (int i = 0; i <= rows; i++)
        d[i][0] = i;
    for (int k = 0; k <= columns; k++)
        d[0][k] = k;
    for (int i = 1; i <= rows; i++)
        for (int k = 1; k <= columns; k++) {
            int changed = d[i - 1][k - 1] + !same_letter(a[i - 1], b[k - 1]);
            d[i][k] = lowest(changed, 1 + lowest(d[i - 1][k], d[i][k - 1]));
            if (i > 1 && k > 1 && same_letter(a[i - 1], b[k - 2]) &&
                same_letter(a[i - 2], b[k - 1]))
                d[i][k] = lowest(d[i][k], d[i - 2][k - 2] + 1);
        }
    return d[rows][columns];
}

const char *nearest_name(const char *word, const char *const *names) {
    int length = (int)strlen(word), best = length < 6 ? 1 : length / 3;
    const char *nearest = NULL;
    for (int i = 0; names[i]; i++) {
        int far = distance(word, names[i]);
        if (far < best + !nearest) {
            best = far;
            nearest = names[i];
        }
    }
    return nearest;
}
