#include "base/argument.h"
#include "base/log.h"
#include "link/link.h"
#include "link/servers.h"
#include "tools/tools.h"

#include <getopt.h>
#include <stdio.h>

static const char enrol_help[] =
    "Usage: arthron-station enrol HOST:PORT CODE --name STATION --keys DIR\n"
    "\n"
    "Gets a certificate with a one-time code of `arthron-server keys enrol`. Exits with 3\n"
    "if it needs another code, and with 1 if the same code may work later.\n"
    "\n"
    "  -n, --name STATION  the station's name, for which the code was made\n"
    "  -k, --keys DIR      the folder for the key and the certificate\n"
    "      --help          show this\n";

static const char enrol_command[] = "arthron-station enrol";

static int enrol(const char *server, const char *code, const char *name, const char *keys) {
    struct server_address at;
    struct error err;
    if (!server_parse(server, &at)) {
        log_error("station", "the server's address must be HOST:PORT, not %s", server);
        return 2;
    }
    enum result result = link_enrol(at.host, at.port, code, name, keys, &err);
    if (result != RESULT_OK) {
        bool needs_code = result == RESULT_REFUSED || result == RESULT_INVALID ||
                          result == RESULT_FORMAT || result == RESULT_CORRUPT;
        log_error("station", "%s", err.text);
        return needs_code ? 3 : 1;
    }
    log_info("station", "%s is enrolled; its key is in %s", name, keys);
    return 0;
}

int tool_enrol(int argc, char **argv) {
    static const struct option options[] = {
        {"name", required_argument, NULL, 'n'},
        {"keys", required_argument, NULL, 'k'},
        {"help", no_argument, NULL, 'h'},
        {0},
    };
    const char *name = NULL, *keys = NULL;
    for (int o; (o = getopt_long(argc, argv, "n:k:", options, NULL)) != -1;) {
        if (o == 'h') {
            fputs(enrol_help, stdout);
            return 0;
        } else if (o == 'n') {
            name = optarg;
        } else if (o == 'k') {
            keys = optarg;
        } else {
            return argument_help(enrol_command);
        }
    }
    if (argc - optind != 2)
        return argument_wrong(enrol_command, "HOST:PORT and CODE are required");
    if (!name || !keys)
        return argument_wrong(enrol_command, "--name and --keys are required");
    return enrol(argv[optind], argv[optind + 1], name, keys);
}
