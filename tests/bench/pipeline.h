// The way of a pose through a worker without its sockets: sealed frames from memory are opened,
// stepped, recorded, answered and sealed.
#pragma once

#include "bench.h"
#include "samples.h"

struct scene;

// Adds `rounds` ratios: the poses a second of two threads, each on a processor of its own, over
// those of one. The traces go into the folder.
enum result pipeline_two_over_one(const struct scene *scene, const char *folder, int rounds,
                                  struct samples *out_ratios, struct error *err);
