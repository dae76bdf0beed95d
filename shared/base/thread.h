// How soon a thread runs when it has something to do. Hints, for the calling thread only: where the
// kernel takes none of it, nothing changes.
#pragma once

// For a thread that sleeps most of the time and must not wait when it wakes: it asks for little at
// a time, so that it goes before a thread that is at work (Linux 6.12; older kernels do so anyway).
void thread_wakes_at_once(void);

// For slow work beside such threads: a lower priority.
void thread_works_beside(void);
