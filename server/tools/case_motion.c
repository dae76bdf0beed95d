#include "case_commands.h"
#include "motion/motion.h"

#include <errno.h>
#include <getopt.h>
#include <stdio.h>
#include <string.h>

static const char motion_help[] =
    "Usage: arthron-case motion SCRIPT --case DIR --out FILE.csv\n"
    "\n"
    "Computes the motion of a trainee's hands and of the joint from the anatomy of a case.\n"
    "arthron-mockup plays it. SCRIPT is an INI file (cases/motions/palpation.ini);\n"
    "cases/README.md explains its keys and the columns. The same script on the same case gives\n"
    "the same bytes.\n"
    "\n"
    "  --case DIR       the case\n"
    "  --out FILE.csv   write the motion here\n";

enum result write_motion(const struct motion *motion, const char *path, struct error *err) {
    FILE *file = fopen(path, "w");
    if (!file)
        return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    enum result result = motion_write(motion, file, err);
    if (fclose(file) != 0 && result == RESULT_OK)
        result = fail(err, RESULT_IO, "%s", strerror(errno));
    if (result == RESULT_OK)
        return result;
    remove(path);
    return fail_in(err, result, "%s: ", path);
}

static int run_motion(const char *path, const char *dir, const char *out) {
    struct motion_script script;
    struct knee_case *knee;
    struct motion motion;
    struct error err;
    if (motion_script_load(path, &script, &err) != RESULT_OK ||
        case_load(dir, NULL, &knee, &err) != RESULT_OK)
        return failed("motion", &err);
    enum result result = motion_plan(knee, &script, &motion, &err);
    for (int i = 0; result == RESULT_OK && i < motion.skipped_count; i++)
        fprintf(stderr, "arthron-case motion: left out: %s\n", motion.skipped[i].text);
    if (result != RESULT_OK)
        fail_in(&err, result, "%s: ", path);
    else
        result = write_motion(&motion, out, &err);
    motion_fini(&motion);
    case_destroy(&knee);
    return result == RESULT_OK ? EXIT_OK : failed("motion", &err);
}

int command_motion(int argc, char **argv) {
    static const struct option options[] = {{"case", required_argument, NULL, 'c'},
                                            {"out", required_argument, NULL, 'o'},
                                            {"help", no_argument, NULL, 'h'},
                                            {0}};
    const char *dir = NULL, *out = NULL;
    int option;
    while ((option = getopt_long(argc, argv, "", options, NULL)) != -1) {
        switch (option) {
        case 'h':
            fputs(motion_help, stdout);
            return EXIT_OK;
        case 'c':
            dir = optarg;
            break;
        case 'o':
            out = optarg;
            break;
        default:
            return EXIT_USAGE;
        }
    }
    if (optind + 1 != argc)
        return usage_error("motion", "one script is needed");
    if (!dir || !out)
        return usage_error("motion", "--case and --out are needed");
    return run_motion(argv[optind], dir, out);
}
