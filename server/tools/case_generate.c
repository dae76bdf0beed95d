#include "case_commands.h"
#include "generate/generate.h"
#include "landmarks/landmarks.h"

#include <getopt.h>
#include <stdio.h>

static const char generate_help[] =
    "Usage: arthron-case generate RECIPE --out DIR\n"
    "\n"
    "Makes a case of a parametric knee. RECIPE is a folder with recipe.ini (cases/healthy), or\n"
    "the file itself. cases/README.md explains its keys. The same recipe gives the same bytes.\n"
    "\n"
    "  --out DIR        write the case here\n";

static int run_generate(const char *path, const char *out) {
    struct recipe recipe;
    struct knee_case *knee = NULL;
    struct error err;
    if (recipe_load(path, &recipe, &err) != RESULT_OK)
        return failed("generate", &err);
    enum result result = generate_knee(&recipe, &knee, &err);
    if (result == RESULT_OK)
        result = landmarks_find(knee, NULL, &err);
    if (result != RESULT_OK)
        fail_in(&err, result, "%s: ", path);
    else
        result = case_save(knee, out, &err);
    case_destroy(&knee);
    return result == RESULT_OK ? EXIT_OK : failed("generate", &err);
}

int command_generate(int argc, char **argv) {
    static const struct option options[] = {
        {"out", required_argument, NULL, 'o'}, {"help", no_argument, NULL, 'h'}, {0}};
    const char *out = NULL;
    int option;
    while ((option = getopt_long(argc, argv, "", options, NULL)) != -1) {
        switch (option) {
        case 'h':
            fputs(generate_help, stdout);
            return EXIT_OK;
        case 'o':
            out = optarg;
            break;
        default:
            return EXIT_USAGE;
        }
    }
    if (optind + 1 != argc)
        return usage_error("generate", "one recipe is needed");
    if (!out)
        return usage_error("generate", "--out is needed");
    return run_generate(argv[optind], out);
}
