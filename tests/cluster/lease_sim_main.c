// The simulation of the lease, by hand: as many servers and stations as wanted.
#include "base/argument.h"
#include "base/number.h"
#include "lease_sim.h"

#include <getopt.h>
#include <inttypes.h>
#include <stdio.h>

static const char program[] = "lease-sim";
static const char help[] =
    "Usage: lease-sim [--servers N] [--stations N] [--seconds N] [--seed N]\n"
    "\n"
    "Simulates the lease and the journals of servers that are killed, paused and cut off, and\n"
    "prints what came of it as JSON. Exits 1 where two served one station, one is served by "
    "nobody\n"
    "at the end, or a session went on without what was safe.\n"
    "\n"
    "      --servers N   1 to 10000 (1000)\n"
    "      --stations N  1 to 10000 (1000)\n"
    "      --seconds N   of trouble, 1 to 100000 (20)\n"
    "      --seed N      what happens follows from it (1)\n";

static bool take(int option, const char *text, struct lease_sim *sim) {
    int64_t number;
    if (!number_int(text, 1, option == 't' ? 100000 : option == 'e' ? INT32_MAX : 10000, &number))
        return false;
    if (option == 's')
        sim->servers = (int)number;
    else if (option == 'n')
        sim->stations = (int)number;
    else if (option == 't')
        sim->trouble_s = (double)number;
    else
        sim->seed = (uint64_t)number;
    return true;
}

int main(int argc, char **argv) {
    static const struct option options[] = {
        {"servers", required_argument, NULL, 's'}, {"stations", required_argument, NULL, 'n'},
        {"seconds", required_argument, NULL, 't'}, {"seed", required_argument, NULL, 'e'},
        {"help", no_argument, NULL, 'h'},          {0},
    };
    struct lease_sim sim = {1, 1000, 1000, 1, 20, 50, 0.01};
    for (int o; (o = getopt_long(argc, argv, "", options, NULL)) != -1;) {
        if (o == 'h') {
            fputs(help, stdout);
            return 0;
        }
        if (o == '?')
            return argument_help(program);
        if (!take(o, optarg, &sim))
            return argument_wrong(program, "%s is no number in its range", optarg);
    }
    struct lease_figures f = lease_sim_run(&sim);
    printf("{\"double_owners\":%" PRIu64 ",\"sinking_tokens\":%" PRIu64 ",\"takes\":%" PRIu64
           ",\"deposals\":%" PRIu64 ",\"lives_lost\":%" PRIu64 ",\"writes\":%" PRIu64
           ",\"unserved\":%d,\"longest_gap_s\":%.1f,\"restored\":%" PRIu64 ",\"lost\":%" PRIu64
           ",\"risen\":%" PRIu64 ",\"torn\":%" PRIu64 "}\n",
           f.double_owners, f.sinking_tokens, f.takes, f.deposals, f.lives_lost, f.writes,
           f.unserved, f.longest_gap_s, f.restored, f.lost, f.risen, f.torn);
    return f.double_owners || f.sinking_tokens || f.unserved || f.lost || f.risen || f.torn;
}
