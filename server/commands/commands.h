// The subcommands of arthron-server. Each takes its own arguments (argv[0] is its name) and returns
// an exit code: 0 done, 1 it failed, 2 wrong usage.
#pragma once

int command_run(int argc, char **argv);
int command_keys(int argc, char **argv);
int command_session(int argc, char **argv);
int command_records(int argc, char **argv);
int command_backup(int argc, char **argv);
int command_restore(int argc, char **argv);
int command_read_case(int argc, char **argv); // hidden: for the server itself
int command_rehearse(int argc, char **argv);  // too

// Who this is, for the records' audit log: the user of the system.
const char *records_actor(void);
