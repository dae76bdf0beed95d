// The end of a program that prints.
#pragma once

// The program's status: `status`, or 1 if that is 0 and what was printed on stdout did not arrive,
// as on a full disk. It then says so. `program`: its name.
int output_end(const char *program, int status);
