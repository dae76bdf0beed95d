// Memory of OpenSSL and libwebsockets is allocated as our own (base/check.h): what is kept back
// bridges a shortage, and without memory the program ends in order. By themselves both go on with
// NULL here and there.
#pragma once

// Call it first in main: before either library allocates.
void libraries_use_our_memory(void);
