// Tissue that tests cut, and S'' that follows it (match/conform.h).
#pragma once

#include "cut/cut.h"
#include "match/conform.h"
#include "random.h"

struct body {
    struct mesh whole;
    float *maxcut;
    struct match_surface *surface;
    struct conform *conform;
    struct cut_mesh *cut;
};

void body_sphere(struct body *b, int n);
void body_meniscus(struct body *b);
void body_giving_meniscus(struct body *b, double way_mm); // S'_max moves each vertex by so much
void body_lens(struct body *b, int n); // thin enough for its two sides to hinder one another
void body_fini(struct body *b);

// T after a cut. The caller releases it with cut_state_fini.
struct cut_state {
    struct mesh mesh;
    bool *fresh;
    double volume;
};

void cut_state_fini(struct cut_state *state);

// A bite at a random place of T; false where it changed nothing.
bool body_bite(struct body *b, struct random *r, struct cut_state *out);
// 10 mm of the body of a meniscus; the smaller of the parts beside it comes off.
void body_take_section(struct body *b, struct cut_state *out);

// By the newest rules.
struct conform_report follow(struct conform *conform, const struct cut_state *state, bool lays);
// By those before rules 11 (step/settings.h).
struct conform_report follow_thoroughly(struct conform *conform, const struct cut_state *state);

// Oracles.
int body_crossings(const struct body *b); // of S''
double body_volume(const struct body *b); // inside it
bool same_bits(const struct conform *a, const struct conform *b, uint32_t count);
// The volume that is in only one of T and the surface that is touched: S'', or S before any fit.
double body_apart_mm3(const struct body *b, const struct cut_state *state, bool fitted);
