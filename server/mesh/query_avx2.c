#if defined(__x86_64__)

#define WIDE 8
#include "mesh/query_search.h"

__attribute__((target("avx2"))) void nearest_search_avx2(struct nearest_search *search) {
    search_tree(search);
}

#endif
