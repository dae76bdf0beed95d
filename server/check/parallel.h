// Runs the same work on many items, on all cores.
#pragma once

typedef void parallel_work(void *context, int index);

// Gets how much is done, from 0 to 1, never two calls at once.
struct progress {
    void (*tell)(void *context, double share);
    void *context;
};

// Calls work for each index from 0 to count - 1 once, in any order, on several threads, and returns
// when all is done. progress: NULL, or told after each.
void parallel_for(int count, parallel_work *work, void *context, const struct progress *progress);
