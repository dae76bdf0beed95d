#if defined(__x86_64__)

#define WIDE 8
#define WIDE_TARGET __attribute__((target("avx2")))
#include "mesh/query_search.h"

WIDE_TARGET void nearest_search_avx2(struct nearest_search *search) {
    search_tree(search);
}

WIDE_TARGET void nearest_look_avx2(struct nearest_search *search) {
    look_near(search);
}

#endif
