#include "mesh/library_memory.h"

extern "C" {
#include "base/check.h"
}

#include <cstdlib>
#include <exception>
#include <new>

namespace {

// Whoever asked tries again when this returns.
void give_up_room() {
    if (!memory_give_up())
        throw std::bad_alloc();
}

[[noreturn]] void end_in_order() {
    try {
        if (std::current_exception())
            std::rethrow_exception(std::current_exception());
    } catch (const std::bad_alloc &) {
        NEED(false, "memory");
    } catch (...) {
    }
    std::abort();
}

} // namespace

void cxx_libraries_use_our_memory(void) {
    std::set_new_handler(give_up_room);
    std::set_terminate(end_in_order);
}
