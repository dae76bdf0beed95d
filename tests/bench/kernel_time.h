// The thread's processor time, and how much of it cuts and fits take: the linker puts ours in their
// place (-Wl,--wrap).
#pragma once

struct kernel_time {
    double cut_ms, fit_ms; // in cut_apply and in conform_to
    int cuts, fits;
};

double thread_ms(void);

struct kernel_time kernel_time_of_thread(void); // since it began
