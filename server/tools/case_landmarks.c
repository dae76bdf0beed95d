#include "base/number.h"
#include "case_commands.h"
#include "case_landmarks_report.h"

#include <getopt.h>
#include <stdio.h>
#include <string.h>

#define GIVEN_MAX CASE_LANDMARKS_MAX

static const char landmarks_help[] =
    "Usage: arthron-case landmarks DIR [--out DIR] [OPTION...]\n"
    "\n"
    "Proposes joint, paths, landmarks and portals of a knee, and prints them with residuals. They\n"
    "replace those of the case, also those given to `import`, unless --keep names them. With "
    "--out\n"
    "it writes the case with the proposals; DIR itself may be the folder.\n"
    "\n"
    "  joint      the flexion axis, from a circle about each posterior condyle\n"
    "  rest       the tibia over flexion: both compartments keep their gap of extension\n"
    "  patella    the patella on its trochlea over flexion\n"
    "  landmarks  trochlea, notch, condyles, plateaus, the feet of both cruciate ligaments, "
    "horns,\n"
    "             bodies and roots of the menisci, patella\n"
    "  portals    anterolateral and anteromedial, with a clear way to the notch\n"
    "\n"
    "  --out DIR            write the case here\n"
    "  --report FILE.html   a page with pictures and all numbers\n"
    "  --keep A,B,...       leave these as the case has them: joint, rest, patella, portals\n"
    "  --joint x,y,z,qw,qx,qy,qz   the joint's frame, by hand (mm, RAS)\n"
    "  --portal NAME=x,y,z,dx,dy,dz\n"
    "                       a portal by hand; the others are proposed\n"
    "  --landmark NAME=BODY:x,y,z\n"
    "                       a landmark by hand, in the frame of femur, tibia or patella (mm).\n"
    "                       Later proposals leave it as it is\n"
    "  --json               print as JSON\n"
    "\n"
    "A case with torn ligaments keeps its joint and rest path, because their keys belong to it.\n";

struct request {
    const char *dir, *out, *report;
    bool json, has_joint;
    struct landmarks_kept keep;
    pose joint;
    int landmark_count, portal_count;
    struct case_landmark landmarks[GIVEN_MAX];
    struct case_portal portals[CASE_PORTALS_MAX];
};

static bool take_name(const char *text, const char **out_rest, char *out_name) {
    const char *equals = strchr(text, '=');
    if (!equals || equals - text >= CASE_NAME_MAX)
        return false;
    memcpy(out_name, text, (size_t)(equals - text));
    out_name[equals - text] = '\0';
    *out_rest = equals + 1;
    return case_name_is_valid(out_name);
}

static bool take_landmark(const char *text, struct request *request) {
    if (request->landmark_count == GIVEN_MAX)
        return false;
    struct case_landmark *landmark = &request->landmarks[request->landmark_count++];
    const char *rest;
    char body[CASE_NAME_MAX];
    double v[3];
    *landmark = (struct case_landmark){.by_hand = true};
    if (!take_name(text, &rest, landmark->name))
        return false;
    size_t length = strcspn(rest, ":");
    if (rest[length] != ':' || length >= sizeof body)
        return false;
    snprintf(body, sizeof body, "%.*s", (int)length, rest);
    bool good = body_from_name(body, &landmark->body) && parse_numbers(rest + length + 1, v, 3);
    landmark->at = good ? (vec3){v[0], v[1], v[2]} : (vec3){0};
    return good;
}

static bool take_portal(const char *text, struct request *request) {
    if (request->portal_count == CASE_PORTALS_MAX - 2)
        return false;
    struct case_portal *portal = &request->portals[request->portal_count++];
    const char *rest;
    double v[6];
    if (!take_name(text, &rest, portal->name) || !parse_numbers(rest, v, 6))
        return false;
    portal->position = (vec3){v[0], v[1], v[2]};
    portal->direction = vec3_unit_or((vec3){v[3], v[4], v[5]}, (vec3){0});
    return vec3_length(portal->direction) > 0;
}

static bool take_keep(const char *text, struct landmarks_kept *keep) {
    static const char *const names[] = {"joint", "rest", "patella", "portals"};
    bool *const kept[] = {&keep->joint, &keep->rest, &keep->patella, &keep->portals};
    for (const char *at = text;;) {
        size_t length = strcspn(at, ",");
        int i = 0;
        while (i < 4 && (strlen(names[i]) != length || strncmp(names[i], at, length) != 0))
            i++;
        if (i == 4)
            return false;
        *kept[i] = true;
        if (!at[length])
            return true;
        at += length + 1;
    }
}

static bool take_landmarks_option(int option, struct request *request) {
    switch (option) {
    case 'o':
        request->out = optarg;
        return true;
    case 'r':
        request->report = optarg;
        return true;
    case 'k':
        return take_keep(optarg, &request->keep);
    case 'j':
        request->has_joint = request->keep.joint = true;
        return number_pose(optarg, &request->joint);
    case 'p':
        return take_portal(optarg, request);
    case 'l':
        return take_landmark(optarg, request);
    default:
        request->json = true;
        return true;
    }
}

// ---- the proposals ------------------------------------------------------------------------------

static void put_portal(struct landmarks_said *said, const struct case_portal *portal) {
    struct knee_case *knee = said->knee;
    int i = 0;
    while (i < knee->portal_count && strcmp(knee->portals[i].name, portal->name) != 0)
        i++;
    if (i < CASE_PORTALS_MAX) {
        knee->portals[i] = *portal;
        said->by_hand[i] = true;
        knee->portal_count += i == knee->portal_count;
    }
}

static enum result give(struct knee_case *knee, const struct request *request, struct error *err) {
    if (request->has_joint && knee->key_count)
        return fail(err, RESULT_INVALID,
                    "--joint: the case has torn ligaments, whose keys belong to its joint");
    if (request->has_joint)
        knee->joint.T_femur_joint = knee->joint.T_tibia_joint = request->joint;
    enum result result = RESULT_OK;
    for (int i = 0; i < request->landmark_count && result == RESULT_OK; i++)
        result = case_landmark_set(knee, &request->landmarks[i], err);
    return result;
}

// The fit is needed for the joint alone: one that is kept needs none.
static enum result fit_joint(struct landmarks_said *said, struct error *err) {
    struct knee_case *knee = said->knee;
    enum result result = landmarks_fit_joint(knee, &said->joint, err);
    said->has_fit = result == RESULT_OK;
    if (said->has_fit && !said->kept.joint)
        knee->joint.T_femur_joint = knee->joint.T_tibia_joint = said->joint.T_femur_joint;
    if (said->has_fit || !said->kept.joint)
        return result == RESULT_OK ? RESULT_OK
                                   : fail_in(err, result, "joint (give it with --joint): ");
    landmarks_note(&said->notes, "%s", err->text);
    return RESULT_OK;
}

static enum result find_landmarks(struct landmarks_said *said, struct error *err) {
    enum result result = landmarks_find(said->knee, &said->notes, err);
    return result == RESULT_INVALID && !said->has_fit ? RESULT_OK : result;
}

static enum result find_portals(struct landmarks_said *said, struct error *err) {
    struct knee_case *knee = said->knee;
    int before = knee->portal_count;
    enum result result = landmarks_find_portals(knee, said->clear_mm, err);
    if (result != RESULT_OK)
        return fail_in(err, result, "portals (--keep portals leaves them as they are): ");
    if (before)
        landmarks_note(&said->notes,
                       "replaces the %d portal%s of the case; --keep portals keeps %s", before,
                       before > 1 ? "s" : "", before > 1 ? "them" : "it");
    return RESULT_OK;
}

static enum result propose(struct knee_case *knee, struct request *request,
                           struct landmarks_said *said, struct error *err) {
    struct landmarks_kept *keep = &request->keep;
    keep->joint |= knee->key_count > 0;
    keep->rest |= knee->key_count > 0;
    said->knee = knee;
    said->kept = *keep;
    enum result result = give(knee, request, err);
    if (result == RESULT_OK)
        result = fit_joint(said, err);
    if (result == RESULT_OK && !keep->rest) {
        result = landmarks_fit_rest(knee, &said->path, err);
        if (result != RESULT_OK)
            return fail_in(err, result, "rest path (--keep rest leaves it as it is): ");
    }
    if (result == RESULT_OK && !keep->patella) {
        result = landmarks_fit_patella(knee, &said->path, err);
        if (result != RESULT_OK)
            return fail_in(err, result, "patella (--keep patella leaves it as it is): ");
    }
    if (result == RESULT_OK)
        result = find_landmarks(said, err);
    if (result == RESULT_OK && !keep->portals)
        result = find_portals(said, err);
    for (int i = 0; i < request->portal_count && result == RESULT_OK; i++)
        put_portal(said, &request->portals[i]);
    return result == RESULT_OK ? case_validate(knee, err) : result;
}

static int run_landmarks(struct request *request) {
    struct knee_case *knee = NULL;
    struct landmarks_said said = {0};
    struct error err;
    enum result result = case_load(request->dir, NULL, &knee, &err);
    if (result == RESULT_OK)
        result = propose(knee, request, &said, &err);
    if (result == RESULT_OK && request->report)
        result = landmarks_report(&said, request->report, &err);
    if (result == RESULT_OK && request->out)
        result = case_save(knee, request->out, &err);
    if (result == RESULT_OK && request->json)
        landmarks_print_json(&said);
    else if (result == RESULT_OK)
        landmarks_print(&said);
    case_destroy(&knee);
    return result == RESULT_OK ? EXIT_OK : failed("landmarks", &err);
}

int command_landmarks(int argc, char **argv) {
    static const struct option options[] = {{"out", required_argument, NULL, 'o'},
                                            {"report", required_argument, NULL, 'r'},
                                            {"keep", required_argument, NULL, 'k'},
                                            {"joint", required_argument, NULL, 'j'},
                                            {"portal", required_argument, NULL, 'p'},
                                            {"landmark", required_argument, NULL, 'l'},
                                            {"json", no_argument, NULL, 'J'},
                                            {"help", no_argument, NULL, 'h'},
                                            {0}};
    static struct request request;
    int option, which = 0;
    while ((option = getopt_long(argc, argv, "", options, &which)) != -1) {
        if (option == 'h') {
            fputs(landmarks_help, stdout);
            return EXIT_OK;
        }
        if (option == '?')
            return EXIT_USAGE;
        if (!take_landmarks_option(option, &request))
            return usage_error("landmarks",
                               "--%s %s: not of the form that --help shows, or given too often",
                               options[which].name, optarg);
    }
    if (optind + 1 != argc)
        return usage_error("landmarks", "one case folder is needed");
    request.dir = argv[optind];
    return run_landmarks(&request);
}
