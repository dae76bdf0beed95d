// The real mock-up program as a child of a test.
#pragma once

#include <sys/types.h>

struct mockup {
    pid_t pid;
    char modbus_tcp[64], modbus_rtu[128], tracker[64]; // what it said, empty where it said nothing
};

// Starts the program with `arguments`, ended by NULL, and reads as many lines as it should say.
struct mockup started(int lines, const char *const *arguments);

#define start(lines, ...) started(lines, (const char *const[]){__VA_ARGS__, NULL})

// Its exit code after the signal; -1 where it died of it.
int ended(struct mockup *m, int signal_number);
