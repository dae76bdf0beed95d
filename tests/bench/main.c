#include "base/check.h"
#include "base/log.h"
#include "report.h"

#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const struct bench {
    const char *name, *help;
    bench_run *run;
} benches[] = {
    {"cluster", "several servers: one is killed or drained, and another goes on", bench_cluster},
    {"cut", "mesh cuts: what holds after each, their time, their messages; of cases too (--case)",
     bench_cut},
    {"devices",
     "rate and latency of each driver (NAME: only that one); each fault: noticed, recovered",
     bench_devices},
    {"fidelity",
     "how good the illusion is: lesions on a generated knee and on cases (--case), each field",
     bench_fidelity},
    {"match", "volume matching after real cuts: its time and error, beside bisection", bench_match},
    {"metrics", "how noise, rate and lost samples change a session's metrics", bench_metrics},
    {"paper", "what the paper shows, beside its own figures; as a page with --out", bench_paper},
    {"resume", "how long a killed server needs until an hour's session goes on", bench_resume},
    {"server", "a real server and its stations, beside an echo of the same datagrams",
     bench_server},
    {"tasks",
     "an expert's and a novice's hands at each task (NAME: only that one); one verdict in any life",
     bench_tasks},
    {"trace",
     "the record of a session: made, killed, replayed, exported, scored; or of traces (FILE)",
     bench_trace},
    {"warp", "time of one warp, and exactness of closest points", bench_warp},
};

#define BENCH_COUNT (sizeof benches / sizeof benches[0])

static void print_help(void) {
    fputs("Usage: arthron-bench NAME [--json] [--quick] [--case DIR ...] [--out DIR] [FILE ...]\n"
          "\n"
          "Measures, and holds the figures against marks: exit 1 where one does not hold.\n"
          "\n",
          stdout);
    for (size_t i = 0; i < BENCH_COUNT; i++)
        printf("  %-10s %s\n", benches[i].name, benches[i].help);
    fputs("\n"
          "  -c, --case DIR  a case to measure; may be given again\n"
          "  -o, --out DIR   where a page with pictures goes (paper)\n"
          "  -q, --quick     fewer samples, under 40 s\n"
          "  -j, --json      one object of JSON\n"
          "      --help      show this\n"
          "      --version   show the version\n",
          stdout);
}

struct arguments {
    bool json, quick;
    const char **inputs;
    int input_count;
    const char *out;
};

// 'h', 'V': asked for; '?': wrong; 0: go on.
static int parse(int argc, char **argv, struct arguments *out) {
    static const struct option options[] = {
        {"json", no_argument, NULL, 'j'},
        {"quick", no_argument, NULL, 'q'},
        {"case", required_argument, NULL, 'c'},
        {"out", required_argument, NULL, 'o'},
        {"help", no_argument, NULL, 'h'},
        {"version", no_argument, NULL, 'V'},
        {0},
    };
    for (int o; (o = getopt_long(argc, argv, "jqc:o:", options, NULL)) != -1;) {
        if (o == 'j')
            out->json = true;
        else if (o == 'q')
            out->quick = true;
        else if (o == 'c')
            out->inputs[out->input_count++] = optarg;
        else if (o == 'o')
            out->out = optarg;
        else
            return o;
    }
    return 0;
}

static const struct bench *find(const char *name) {
    for (size_t i = 0; i < BENCH_COUNT; i++)
        if (!strcmp(benches[i].name, name))
            return &benches[i];
    return NULL;
}

static int measure(const struct bench *bench, const struct arguments *arguments) {
    struct bench_options options = {arguments->quick, arguments->inputs, arguments->input_count,
                                    arguments->out};
    struct report *report = report_create(bench->name);
    struct error err;
    int status = 1;
    if (bench->run(&options, report, &err) != RESULT_OK) {
        log_error("bench", "%s: %s", bench->name, err.text);
    } else {
        (arguments->json ? report_print_json : report_print_table)(report);
        status = report_holds(report) ? 0 : 1;
    }
    report_destroy(&report);
    return status;
}

int main(int argc, char **argv) {
    struct arguments arguments = {.inputs = alloc((unsigned long)argc, sizeof(char *))};
    int problem = parse(argc, argv, &arguments), status = 2;
    const struct bench *bench = optind < argc ? find(argv[optind]) : NULL;
    for (int i = optind + 1; i < argc; i++)
        arguments.inputs[arguments.input_count++] = argv[i];
    if (problem == 'h') {
        print_help();
        status = 0;
    } else if (problem == 'V') {
        puts("arthron-bench " ARTHRON_VERSION);
        status = 0;
    } else if (!problem && !bench) {
        log_error("bench", "%s; see --help", optind < argc ? "no such bench" : "name a bench");
    } else if (!problem) {
        status = measure(bench, &arguments);
    }
    free(arguments.inputs);
    return status;
}
