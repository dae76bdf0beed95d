// What C++ libraries do without memory, for programs that use them (Embree, tinygltf, OpenMesh,
// OpenEXR). Their threads and destructors throw where nobody catches: that ends the program in
// order (base/check.h) instead of by SIGABRT. Before they throw, they get what is kept back.
#pragma once

#ifdef __cplusplus
extern "C" {
#endif

// Call it first in main.
void cxx_libraries_use_our_memory(void);

#ifdef __cplusplus
}
#endif
