// The name that a mistyped word was meant to be, for "did you mean ...?".
#pragma once

// The one of `names` (ended by NULL) that needs the fewest changed, missing, added or swapped
// letters, upper and lower case alike; the first of several. NULL where it takes more than a third
// of the word's letters (always one).
const char *nearest_name(const char *word, const char *const *names);
