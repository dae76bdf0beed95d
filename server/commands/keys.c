#include "commands/commands.h"
#include "commands/known_stations.h"
#include "net/authority.h"

#include <getopt.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

static const char keys_help[] =
    "Usage: arthron-server keys init DIR [HOST ...] [OPTION ...]\n"
    "       arthron-server keys renew DIR [HOST ...] [OPTION ...]\n"
    "       arthron-server keys encrypt DIR --new-passphrase FILE [OPTION ...]\n"
    "       arthron-server keys decrypt DIR [OPTION ...]\n"
    "       arthron-server keys enrol DIR STATION\n"
    "       arthron-server keys revoke DIR STATION\n"
    "\n"
    "init    makes the authority and the server's certificate for these host names and addresses\n"
    "        (localhost and 127.0.0.1 if none is given)\n"
    "renew   makes a new certificate for the server, good for 2 years, under the same authority:\n"
    "        for these host names and addresses, or for the present ones if none is given. A\n"
    "        running server takes it within a second; stations and sessions go on\n"
    "encrypt encrypts authority.key, or gives it another passphrase\n"
    "decrypt leaves authority.key in the clear\n"
    "enrol   prints a one-time code, good for 15 minutes; on the station's machine:\n"
    "        arthron-station enrol HOST:PORT CODE --name STATION --keys DIR\n"
    "revoke  refuses all certificates and codes of the station from now on\n"
    "\n"
    "      --authority DIR        where authority.key is, if not in the folder of the other keys\n"
    "      --passphrase FILE      its passphrase: the first line of the file. Default: the "
    "systemd\n"
    "                             credential authority-passphrase. init encrypts with it\n"
    "      --new-passphrase FILE  the same, from now on\n"
    "      --help                 show this\n";

static int report_keys(enum result result, const struct error *err) {
    if (result == RESULT_OK)
        return 0;
    fprintf(stderr, "arthron-server keys: %s\n", err->text);
    return 1;
}

// As they were typed.
struct hosts {
    const char *const *names;
    int count;
};

static int init(const char *dir, struct hosts hosts) {
    static const char *const local[] = {"localhost", "127.0.0.1"};
    struct error err;
    if (!hosts.count)
        hosts = (struct hosts){local, 2};
    return report_keys(authority_init(dir, hosts.names, hosts.count, &err), &err);
}

static int renew(const char *dir, struct hosts hosts) {
    struct authority_server server;
    struct error err;
    char end[32];
    enum result result = authority_renew_server(dir, hosts.names, hosts.count, &server, &err);
    if (result != RESULT_OK)
        return report_keys(result, &err);
    time_t until = (time_t)server.until_utc_s;
    strftime(end, sizeof end, "%Y-%m-%d", gmtime(&until));
    printf("good until %s, for", end);
    for (int i = 0; i < server.host_count; i++)
        printf(" %s", server.hosts[i]);
    putchar('\n');
    return 0;
}

static int enrol_station(const char *dir, const char *station) {
    char code[AUTHORITY_CODE_MAX];
    struct error err;
    enum result result = authority_issue_code(dir, station, code, &err);
    if (result == RESULT_OK) {
        puts(code);
        known_stations_warn(dir, station);
    }
    return report_keys(result, &err);
}

static int revoke_station(const char *dir, const char *station) {
    struct error err;
    return report_keys(authority_revoke(dir, station, &err), &err);
}

static int encrypt_keys(const char *dir, const char *passphrase) {
    struct error err;
    return report_keys(authority_change_passphrase(dir, passphrase, &err), &err);
}

// What is given beside the words.
struct key_options {
    struct authority_key_place place;
    const char *new_passphrase;
};

// -1: go on; else the exit code.
static int take_options(int argc, char **argv, struct key_options *out) {
    static const struct option options[] = {{"authority", required_argument, NULL, 'a'},
                                            {"passphrase", required_argument, NULL, 'p'},
                                            {"new-passphrase", required_argument, NULL, 'n'},
                                            {"help", no_argument, NULL, 'h'},
                                            {0}};
    for (int o; (o = getopt_long(argc, argv, "", options, NULL)) != -1;) {
        if (o == 'a')
            out->place.dir = optarg;
        else if (o == 'p')
            out->place.passphrase = optarg;
        else if (o == 'n')
            out->new_passphrase = optarg;
        else {
            fputs(keys_help, o == 'h' ? stdout : stderr);
            return o == 'h' ? 0 : 2;
        }
    }
    return -1;
}

int command_keys(int argc, char **argv) {
    static struct key_options options; // the place's texts live on
    int code = take_options(argc, argv, &options);
    if (code >= 0)
        return code;
    authority_place_key(&options.place);
    char **rest = argv + optind;
    int count = argc - optind;
    struct hosts hosts = {(const char *const *)(rest + 2), count - 2};
    if (options.new_passphrase && count == 2 && !strcmp(rest[0], "encrypt"))
        return encrypt_keys(rest[1], options.new_passphrase);
    if (!options.new_passphrase && count == 2 && !strcmp(rest[0], "decrypt"))
        return encrypt_keys(rest[1], NULL);
    if (!options.new_passphrase && count >= 2 && !strcmp(rest[0], "init"))
        return init(rest[1], hosts);
    if (!options.new_passphrase && count >= 2 && !strcmp(rest[0], "renew"))
        return renew(rest[1], hosts);
    if (count == 3 && !strcmp(rest[0], "enrol"))
        return enrol_station(rest[1], rest[2]);
    if (count == 3 && !strcmp(rest[0], "revoke"))
        return revoke_station(rest[1], rest[2]);
    fputs(keys_help, stderr);
    return 2;
}
