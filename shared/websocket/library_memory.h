// Memory of OpenSSL, libwebsockets and libuv is allocated as our own (base/check.h): what is kept
// back bridges a shortage, and without memory the program ends in order. By themselves they go on
// with NULL here and there.
#pragma once

// Call it first in main: before any of them allocates.
void libraries_use_our_memory(void);
