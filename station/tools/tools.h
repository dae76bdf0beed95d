// The subcommands of arthron-station. Each takes its own arguments (argv[0] is its name) and
// returns an exit code: 0 done, 1 it failed or found a fault, 2 wrong usage.
#pragma once

int tool_run(int argc, char **argv);
int tool_enrol(int argc, char **argv);
int tool_probe(int argc, char **argv);
int tool_check(int argc, char **argv);
int tool_calibrate(int argc, char **argv);
