#include "base/number.h"
#include "case_commands.h"
#include "case_keys.h"
#include "case_pathology_report.h"
#include "generate/maxcut.h"
#include "generate/pathology.h"

#include <getopt.h>
#include <stdio.h>
#include <string.h>

#define COMMON_HELP                                                                                \
    "  --name NAME      the name of the new case. Default: as before\n"                            \
    "  --title TEXT     the title that people see. Default: as before\n"                           \
    "  --out DIR        write the case here; it may be the same folder\n"
#define RIM_HELP                                                                                   \
    "  --rim-mm MM      what a resection leaves at the capsule, 2 to 8 (default: 3.5)\n"

static const char tear_help[] =
    "Usage: arthron-case tear DIR --kind KIND --group NAME --at SHARE --depth-mm MM\n"
    "                         [--length-mm MM] [OPTION...] --out DIR\n"
    "\n"
    "Tears a meniscus: a cleft of 0.15 mm, the damaged tissue around it, and the planned\n"
    "resection that takes it out. The words are those of a recipe's [tear NAME].\n"
    "\n"
    "  --kind KIND      radial, flap, bucket-handle or horizontal\n"
    "  --group NAME     meniscus_medial or meniscus_lateral\n"
    "  --at SHARE       the middle of the tear, 0.1 to 0.9 of the arc from the anterior to the\n"
    "                   posterior end\n"
    "  --depth-mm MM    its reach from the inner margin, 1 to 8\n"
    "  --length-mm MM   along the arc, at that depth, 2 to 30; not for a radial tear\n" RIM_HELP
        COMMON_HELP "\n"
    "The meniscus becomes cuttable, so it must be one closed mesh. If it has no morph maxcut,\n"
    "the command makes one. Another tear of the same meniscus adds its plan to the first one's.\n";

static const char plan_help[] =
    "Usage: arthron-case plan DIR --group NAME --at SHARE --depth-mm MM --length-mm MM\n"
    "                         [OPTION...] --out DIR\n"
    "\n"
    "Plans a resection of a meniscus, torn or whole, in place of the plan that it has. The words\n"
    "are those of a recipe's [plan NAME].\n"
    "\n"
    "  --group NAME     meniscus_medial or meniscus_lateral\n"
    "  --at SHARE       the middle of the plan, 0.1 to 0.9 of the arc from the anterior to the\n"
    "                   posterior end\n"
    "  --depth-mm MM    its reach from the inner margin, 1 to 9. It always leaves the rim\n"
    "  --length-mm MM   along the arc, at that depth, 2 to 30. Beside it the plan runs out\n"
    "                   smoothly\n" RIM_HELP COMMON_HELP;

static const char cavity_help[] =
    "Usage: arthron-case cavity DIR --body BODY --at PLACE --radius-mm MM --depth-mm MM\n"
    "                           [OPTION...] --out DIR\n"
    "\n"
    "Hollows out a bone. All groups of its body follow: a meniscus above a cavity sinks with its\n"
    "tibia. The words are those of a recipe's [cavity NAME].\n"
    "\n"
    "  --body BODY      tibia or femur\n"
    "  --at PLACE       a landmark of the case (plateau_medial), or X,Y,Z: mm from the joint's\n"
    "                   origin, x lateral (on both sides), y anterior, z proximal. The middle is\n"
    "                   the nearest vertex of the bone\n"
    "  --radius-mm MM   nothing beyond it moves, 3 to 25\n"
    "  --depth-mm MM    in the middle, 0.1 to 6, at most half of the radius\n"
    "  --rim-mm MM      of the morph maxcut of a meniscus that moves: it is made anew (default: "
    "3.5)\n" COMMON_HELP "\n"
    "Make cavities before tears and plans: the command refuses to move a torn meniscus.\n"
    "`arthron-case deform` hollows out groups of your choice.\n";

static const char wear_help[] =
    "Usage: arthron-case wear DIR --body BODY --at PLACE --radius-mm MM --grade GRADE\n"
    "                         [OPTION...] --out DIR\n"
    "\n"
    "Wears a bone's cartilage, as the arthroscope sees it. No shape changes: `arthron-case "
    "cavity`\n"
    "hollows out. The words are those of a recipe's [wear NAME].\n"
    "\n"
    "  --body BODY      tibia, femur or patella\n"
    "  --at PLACE       a landmark of the case (plateau_medial), or X,Y,Z: mm from the joint's\n"
    "                   origin, x lateral (on both sides), y anterior, z proximal. The middle is\n"
    "                   the nearest vertex of the bone\n"
    "  --radius-mm MM   cartilage beyond it stays whole, 3 to 25\n"
    "  --grade GRADE    in the middle, of the International Cartilage Repair Society: 1 soft or\n"
    "                   with cracks, 2 fissured to less than half of its depth, 3 deeper, 4 down\n"
    "                   to the bone. Values between are possible\n" COMMON_HELP;

static const char ligament_help[] =
    "Usage: arthron-case ligament DIR --ligament NAME --flexion-deg LIST --MOTION LIST...\n"
    "                             --extra-MOTION LIST... [OPTION...] --out DIR\n"
    "\n"
    "Tears a ligament: the patient's joint goes further than the mock-up's. The words are those\n"
    "of a recipe's [ligament NAME].\n"
    "\n"
    "  --ligament NAME  mcl, acl, ...\n"
    "  --flexion-deg LIST\n"
    "                   the flexions of the keys: up to 8 of 0 to 120, such as 15,45,65\n"
    "  --valgus-deg LIST, --internal-deg LIST, --drawer-mm LIST\n"
    "                   where the mock-up's ligaments hold the joint: one number, or one for each\n"
    "                   flexion. Negative: varus, external, backward\n"
    "  --extra-valgus-deg LIST, --extra-internal-deg LIST, --extra-drawer-mm LIST\n"
    "                   how much further the patient's joint goes\n" COMMON_HELP;

static const char tissue_help[] =
    "Usage: arthron-case tissue DIR --group NAME [OPTION...] --out DIR\n"
    "\n"
    "Describes a group of a case, or adds one: a plica, a loose body. The words are those of a\n"
    "recipe's [tissue NAME].\n"
    "\n"
    "  --group NAME     the group\n"
    "  --kind KIND      bone, cartilage, meniscus, ligament, synovium, skin or other\n"
    "  --label TEXT     what pages and reports call it\n"
    "  --colour #RRGGBB its colour in pages, pictures and exports (default: the kind's)\n"
    "  --side SIDE      medial, lateral or none\n"
    "  --cuttable yes|no\n"
    "                   whether instruments cut it\n"
    "  --zones yes|no   whether it is C-shaped from above, as a meniscus: zones and rim are "
    "judged\n"
    "Of a new group:\n"
    "  --body BODY      femur, tibia or patella: it moves with this body\n"
    "  --bridges BODY   it reaches this body, as a ligament does\n"
    "  --path LIST      2 to 4 control points of a curve, each X,Y,Z: mm from the joint's origin,\n"
    "                   x lateral, y anterior, z proximal\n"
    "  --width-mm MM, --thickness-mm MM\n"
    "                   of the tube round the curve, 0.5 to 30\n"
    "  --flat X,Y,Z     about the direction in which it is thin (default: 0,0,1)\n" COMMON_HELP;

static const char loose_help[] =
    "Usage: arthron-case loose DIR --loose NAME --count N [OPTION...] --out DIR\n"
    "       arthron-case loose DIR --loose NAME --body BODY --at PLACE [OPTION...] --out DIR\n"
    "\n"
    "Adds loose bodies: rigid pieces of cartilage that lie on a bone, are pushed by instruments\n"
    "and taken out with a grasper. The words are those of a recipe's [loose NAME].\n"
    "\n"
    "  --loose NAME     its name\n"
    "  --count N        so many, NAME_1, NAME_2, ..., at places that hands reach; 1 to 8\n"
    "  --body BODY      tibia or femur\n"
    "  --at PLACE       a landmark of the case (notch), or X,Y,Z: mm from the joint's origin, x\n"
    "                   lateral, y anterior, z proximal. It lies on the nearest surface\n"
    "  --radii-mm X,Y,Z its half axes, 1 to 6 (default: 3.5,3,2). It lies on the side of the\n"
    "                   last\n" COMMON_HELP;

struct pathology_request {
    const char *dir, *out, *name, *title;
    double rim_mm;
    struct pathology step;
};

// ---- the command line ---------------------------------------------------------------------------

#define WORD(name)                                                                                 \
    { name, required_argument, NULL, 'w' }
#define WORDS_MAX 20

static const struct option common[] = {{"name", required_argument, NULL, 'n'},
                                       {"title", required_argument, NULL, 't'},
                                       {"out", required_argument, NULL, 'o'},
                                       {"help", no_argument, NULL, 'h'},
                                       {0}};

static const struct pathology_command {
    const char *help;
    struct option words[WORDS_MAX - 5 + 1]; // ended by zeros; the common ones follow
} pathology_commands[PATHOLOGY_KIND_COUNT] = {
    [PATHOLOGY_TEAR] = {tear_help,
                        {WORD("kind"),
                         WORD("group"),
                         WORD("at"),
                         WORD("depth-mm"),
                         WORD("length-mm"),
                         {"rim-mm", required_argument, NULL, 'r'}}},
    [PATHOLOGY_PLAN] = {plan_help,
                        {WORD("group"),
                         WORD("at"),
                         WORD("depth-mm"),
                         WORD("length-mm"),
                         {"rim-mm", required_argument, NULL, 'r'}}},
    [PATHOLOGY_CAVITY] = {cavity_help,
                          {WORD("body"),
                           WORD("at"),
                           WORD("radius-mm"),
                           WORD("depth-mm"),
                           {"rim-mm", required_argument, NULL, 'r'}}},
    [PATHOLOGY_WEAR] = {wear_help, {WORD("body"), WORD("at"), WORD("radius-mm"), WORD("grade")}},
    [PATHOLOGY_LIGAMENT] = {ligament_help,
                            {{"ligament", required_argument, NULL, 'l'},
                             WORD("flexion-deg"),
                             WORD("valgus-deg"),
                             WORD("internal-deg"),
                             WORD("drawer-mm"),
                             WORD("extra-valgus-deg"),
                             WORD("extra-internal-deg"),
                             WORD("extra-drawer-mm")}},
    [PATHOLOGY_TISSUE] = {tissue_help,
                          {{"group", required_argument, NULL, 'l'},
                           WORD("kind"),
                           WORD("label"),
                           WORD("colour"),
                           WORD("side"),
                           WORD("cuttable"),
                           WORD("zones"),
                           WORD("body"),
                           WORD("bridges"),
                           WORD("path"),
                           WORD("width-mm"),
                           WORD("thickness-mm"),
                           WORD("flat")}},
    [PATHOLOGY_LOOSE] = {loose_help,
                         {{"loose", required_argument, NULL, 'l'},
                          WORD("count"),
                          WORD("body"),
                          WORD("at"),
                          WORD("radii-mm")}},
};

static void gather_options(enum pathology_kind kind, struct option out[WORDS_MAX]) {
    int count = 0;
    while (pathology_commands[kind].words[count].name) {
        out[count] = pathology_commands[kind].words[count];
        count++;
    }
    memcpy(out + count, common, sizeof common);
}

// The option's name is the recipe's word, with hyphens.
static enum result take_word(struct pathology *step, const char *option, const char *value,
                             struct error *err) {
    char key[32];
    snprintf(key, sizeof key, "%s", option);
    for (char *c = key; *c; c++)
        *c = *c == '-' ? '_' : *c;
    return pathology_take(step, key, value, err);
}

static enum result take_option(struct pathology_request *request, int letter, const char *option,
                               const char *value, struct error *err) {
    switch (letter) {
    case 'w':
        return take_word(&request->step, option, value, err);
    case 'r':
        return number_double(value, MAXCUT_RIM_LEAST_MM, MAXCUT_RIM_MOST_MM, &request->rim_mm)
                   ? RESULT_OK
                   : fail(err, RESULT_INVALID, "rim_mm = %s: must be a number from %g to %g", value,
                          MAXCUT_RIM_LEAST_MM, MAXCUT_RIM_MOST_MM);
    case 'n':
    case 'l':
        if (!case_name_is_valid(value))
            return fail(err, RESULT_INVALID, "--%s %s: letters, digits and \"_-.\"", option, value);
        if (letter == 'l')
            strcpy(request->step.name, value);
        else
            request->name = value;
        return RESULT_OK;
    case 't':
        request->title = value;
        return RESULT_OK;
    default:
        request->out = value;
        return RESULT_OK;
    }
}

// EXIT_OK: go on; otherwise the exit status; *out_helped: that was all.
static int parse(int argc, char **argv, struct pathology_request *request, bool *out_helped) {
    struct option options[WORDS_MAX];
    enum pathology_kind kind = request->step.kind;
    const char *command = pathology_kind_name(kind);
    uint32_t given = 0;
    struct error err;
    int letter, which = 0;
    gather_options(kind, options);
    while ((letter = getopt_long(argc, argv, "", options, &which)) != -1) {
        if (letter == '?')
            return EXIT_USAGE;
        if (letter == 'h') {
            fputs(pathology_commands[kind].help, stdout);
            *out_helped = true;
            return EXIT_OK;
        }
        if (given & 1u << which)
            return usage_error(command, "--%s %s: given twice", options[which].name, optarg);
        given |= 1u << which;
        if (take_option(request, letter, options[which].name, optarg, &err) != RESULT_OK)
            return usage_error(command, "%s", err.text);
    }
    if (optind + 1 != argc)
        return usage_error(command, "one case folder is needed");
    if (!request->out)
        return usage_error(command, "--out is needed");
    if (pathology_commands[kind].words[0].val == 'l' && !request->step.name[0])
        return usage_error(command, "--%s is needed", options[0].name);
    if (pathology_check(&request->step, &err) != RESULT_OK)
        return usage_error(command, "%s", err.text);
    request->dir = argv[optind];
    return EXIT_OK;
}

// ---- the case -----------------------------------------------------------------------------------

static enum result change(struct knee_case *knee, const struct pathology_request *request,
                          struct error *err) {
    enum result result = pathology_apply(knee, &request->step, request->rim_mm, err);
    if (request->name)
        snprintf(knee->name, sizeof knee->name, "%s", request->name);
    if (request->title)
        snprintf(knee->title, sizeof knee->title, "%s", request->title);
    if (result == RESULT_OK)
        result = pathology_report(knee, &request->step, err);
    return result == RESULT_OK ? case_save(knee, request->out, err) : result;
}

static int command(enum pathology_kind kind, int argc, char **argv) {
    struct pathology_request request = {.rim_mm = MAXCUT_RIM_MM};
    struct knee_case *knee;
    struct error err;
    bool helped = false;
    pathology_init(&request.step, kind, "");
    int status = parse(argc, argv, &request, &helped);
    if (status != EXIT_OK || helped)
        return status;
    if (case_load(request.dir, NULL, &knee, &err) != RESULT_OK)
        return failed(pathology_kind_name(kind), &err);
    enum result result = change(knee, &request, &err);
    case_destroy(&knee);
    return result == RESULT_OK ? EXIT_OK : failed(pathology_kind_name(kind), &err);
}

int command_cavity(int argc, char **argv) {
    return command(PATHOLOGY_CAVITY, argc, argv);
}

int command_wear(int argc, char **argv) {
    return command(PATHOLOGY_WEAR, argc, argv);
}

int command_ligament(int argc, char **argv) {
    return command(PATHOLOGY_LIGAMENT, argc, argv);
}

int command_plan(int argc, char **argv) {
    return command(PATHOLOGY_PLAN, argc, argv);
}

int command_tear(int argc, char **argv) {
    return command(PATHOLOGY_TEAR, argc, argv);
}

int command_tissue(int argc, char **argv) {
    return command(PATHOLOGY_TISSUE, argc, argv);
}

int command_loose(int argc, char **argv) {
    return command(PATHOLOGY_LOOSE, argc, argv);
}
