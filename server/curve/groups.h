// A pass mark from the figures of two groups: novices and experts. Contrasting groups: Livingston,
// Zieky, Passing Scores (1982); for a test of knee arthroscopy Jacobsen et al., Arthroscopy
// 31:1216-1223 (2015). The mark is where the normal distributions of the two groups cross, between
// their means:
//
//     ln s_n + (x - m_n)^2 / (2 s_n^2) = ln s_e + (x - m_e)^2 / (2 s_e^2).
#pragma once

#include "base/result.h"

#include <stdbool.h>

#define GROUP_MIN 5 // figures; of fewer a standard deviation says little

struct group_shape {
    double mean, sd; // of a sample: divided by n - 1
};

// In the unit of the figures.
struct contrasting_groups {
    double mark; // passed at this or on the experts' side of it
    struct group_shape novices, experts;
    double false_pass, false_fail; // shares of the normal distributions beyond the mark: of novices
                                   // who would pass, of experts who would fail
    int novices_passing, experts_failing; // of the figures themselves
};

// less_is_better: the experts' figures are the smaller ones (a time, errors). RESULT_REFUSED with
// the reason where there is no mark: a group of fewer than GROUP_MIN figures or without any spread,
// experts who are no better, or distributions that do not cross between the means. RESULT_INVALID
// if a figure is not finite.
enum result contrasting_groups(const double *novices, int novice_count, const double *experts,
                               int expert_count, bool less_is_better,
                               struct contrasting_groups *out, struct error *err);
