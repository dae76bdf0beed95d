// Jansson drops what it has no memory for and says so in results that nobody asks for: a manifest
// would lack keys. With our memory (base/check.h) it always has some, or the program ends in order.
#pragma once

// Call it first in main.
void json_uses_our_memory(void);
