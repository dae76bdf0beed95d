// Runs the same work on many items, on all cores.
#pragma once

typedef void parallel_work(void *context, int index);

// Calls work for each index from 0 to count - 1 once, in any order, on several threads, and returns
// when all is done.
void parallel_for(int count, parallel_work *work, void *context);
