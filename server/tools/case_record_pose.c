#include "case/recorded_keys.h"
#include "case_commands.h"
#include "case_keys.h"
#include "net/console.h"
#include "step/session.h"

#include <getopt.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#define READINGS 20
#define READINGS_TRIED 40 // one that is held or lost is not counted
#define READING_MS 50
#define STILL_DEG 0.5
#define STILL_MM 0.5

static const char record_pose_help[] =
    "Usage: arthron-case record-pose DIR --as rest|physical|target [--ligament NAME]\n"
    "                                --station NAME --socket PATH\n"
    "\n"
    "Records the present pose of a running station's joint in the case: the mean of one second.\n"
    "\n"
    "  --as rest        the mock-up at rest. One pose for each flexion makes the rest path; "
    "without\n"
    "                   any, it is the path of the joint's axes\n"
    "  --as physical    the mock-up pushed to its end, with its ligaments mounted. The pose waits\n"
    "                   in recorded.json, beside the case, for its target\n"
    "  --as target      the mock-up pushed further, with the ligament off: here the virtual tibia "
    "appears\n"
    "                   in the physical pose. It completes the pose that waits within 5 degrees\n"
    "                   of flexion, or gives such a key another target\n"
    "  --ligament NAME  the torn ligament, for physical and target\n"
    "  --station NAME   a station with a session on any case of this mock-up\n"
    "  --socket PATH    the server's socket, as in its config\n"
    "\n"
    "With the ligaments mounted, push the joint to its end at some flexions and record each\n"
    "--as physical. Take the ligament off, push further at about the same flexions and record\n"
    "each --as target. A recording replaces an older one within a degree of flexion. The\n"
    "command refuses a joint that moves, is held, or is lost.\n";

enum role { ROLE_REST, ROLE_PHYSICAL, ROLE_TARGET, ROLE_COUNT };

static const char *const role_names[ROLE_COUNT + 1] = {"rest", "physical", "target", NULL};

struct record_pose_request {
    const char *dir, *ligament, *station, *socket;
    enum role role; // ROLE_COUNT: not given
};

// ---- the present pose ---------------------------------------------------------------------------

static enum result read_once(const struct record_pose_request *request, arthron_JointReading *out,
                             struct error *err) {
    static arthron_CommandReply reply;
    arthron_Command command = {.kind = arthron_Command_Kind_SHOW};
    snprintf(command.station, sizeof command.station, "%s", request->station);
    enum result result = console_call(request->socket, &command, &reply, err);
    if (result != RESULT_OK)
        return result;
    if (!reply.ok)
        return fail(err, RESULT_REFUSED, "%s", reply.text);
    if (!reply.has_joint)
        return fail(err, RESULT_MISSING, "station %s has no session", request->station);
    *out = reply.joint;
    return RESULT_OK;
}

// The session's case may be another one, but must place bones as this one does.
static enum result check_frames(const struct knee_case *knee, const arthron_JointReading *reading,
                                struct error *err) {
    struct joint_angles theirs = wire_joint_to(&reading->joint);
    pose here = joint_to_pose(&knee->joint, &theirs), there = wire_pose_to(&reading->pose);
    if (quat_angle(here.rotation, there.rotation) < 1e-6 &&
        vec3_distance(here.translation, there.translation) < 1e-6)
        return RESULT_OK;
    return fail(err, RESULT_INVALID,
                "the station's session is on a case with other joint frames than this one");
}

static pose mean_of(const pose *poses, int count) {
    quat sum = {0};
    vec3 place = {0};
    for (int i = 0; i < count; i++) {
        quat q = poses[i].rotation, first = poses[0].rotation;
        double same = q.w * first.w + q.x * first.x + q.y * first.y + q.z * first.z;
        double sign = same < 0 ? -1 : 1;
        sum =
            (quat){sum.w + sign * q.w, sum.x + sign * q.x, sum.y + sign * q.y, sum.z + sign * q.z};
        place = vec3_add_scaled(place, 1.0 / count, poses[i].translation);
    }
    return (pose){quat_unit(sum), place};
}

// How far the readings are from their mean, of the tibia's joint frame.
static enum result check_still(const struct knee_case *knee, const pose *poses, int count,
                               pose mean, struct error *err) {
    vec3 centre = knee->joint.T_tibia_joint.translation;
    double degrees = 0, mm = 0;
    for (int i = 0; i < count; i++) {
        degrees = fmax(degrees, DEG_PER_RAD * quat_angle(poses[i].rotation, mean.rotation));
        mm = fmax(mm, vec3_distance(pose_apply(poses[i], centre), pose_apply(mean, centre)));
    }
    if (degrees > STILL_DEG || mm > STILL_MM)
        return fail(err, RESULT_REFUSED,
                    "the joint moves: by %.2f degrees and %.2f mm from its mean, where %g and %g "
                    "are still",
                    degrees, mm, STILL_DEG, STILL_MM);
    printf("%d readings within %.2f deg and %.2f mm\n", count, degrees, mm);
    return RESULT_OK;
}

static enum result present_pose(const struct knee_case *knee,
                                const struct record_pose_request *request, pose *out_pose,
                                struct error *err) {
    static const struct timespec pause = {0, READING_MS * 1000000L};
    pose poses[READINGS];
    arthron_JointReading now = {0};
    uint64_t first_step = 0;
    int count = 0;
    for (int tried = 0; tried < READINGS_TRIED && count < READINGS; tried++) {
        enum result result = read_once(request, &now, err);
        if (result == RESULT_OK)
            result = check_frames(knee, &now, err);
        if (result != RESULT_OK)
            return result;
        if (tried == 0)
            first_step = now.step;
        if (now.validity == arthron_Validity_OK)
            poses[count++] = wire_pose_to(&now.pose);
        nanosleep(&pause, NULL);
    }
    if (count < READINGS)
        return fail(err, RESULT_REFUSED, "station %s: the joint is %s", request->station,
                    now.validity == arthron_Validity_OK
                        ? "lost now and then"
                        : validity_name((enum validity)now.validity));
    if (now.step == first_step)
        return fail(err, RESULT_REFUSED, "station %s: its session makes no steps",
                    request->station);
    *out_pose = mean_of(poses, READINGS);
    return check_still(knee, poses, READINGS, *out_pose, err);
}

// ---- into the case ------------------------------------------------------------------------------

static void say_what_waits(const struct knee_case *knee, const struct recorded_keys *record) {
    for (int i = 0; i < record->count; i++)
        printf("%s at %.1f deg of flexion waits for its target\n", record->waiting[i].ligament,
               joint_from_pose(&knee->joint, record->waiting[i].physical).flexion_deg);
}

static enum result take_pose(struct knee_case *knee, const struct record_pose_request *request,
                             pose p, struct recorded_keys *record, struct error *err) {
    int key = -1;
    if (request->role == ROLE_REST) {
        enum result result = recorded_keys_rest(knee, p, err);
        if (result == RESULT_OK)
            printf("at rest at %.1f deg of flexion\n",
                   joint_from_pose(&knee->joint, p).flexion_deg);
        return result;
    }
    if (request->role == ROLE_PHYSICAL)
        return recorded_keys_physical(knee, record, request->ligament, p, err);
    enum result result = recorded_keys_target(knee, record, request->ligament, p, &key, err);
    if (result == RESULT_OK)
        print_key(knee, key);
    return result;
}

// A server does not start with a case whose keys no warp can meet.
static enum result try_keys(const struct knee_case *knee, struct error *err) {
    struct adaptive *adaptive;
    enum result result = scene_adaptive(knee, ADAPTIVE_HINGE, &adaptive, err);
    adaptive_destroy(&adaptive);
    return result == RESULT_OK ? result : fail_in(err, result, "nothing is saved: ");
}

static enum result save(struct knee_case *knee, const struct record_pose_request *request,
                        const struct recorded_keys *record, struct error *err) {
    enum result result = RESULT_OK;
    if (request->role != ROLE_PHYSICAL)
        result = try_keys(knee, err);
    if (result == RESULT_OK && request->role != ROLE_PHYSICAL)
        result = case_save(knee, request->dir, err);
    if (result == RESULT_OK)
        result = recorded_keys_save(request->dir, record, err);
    if (result != RESULT_OK)
        return result;
    say_what_waits(knee, record);
    if (request->role != ROLE_PHYSICAL)
        printf("the case has changed: arthron-case check %s; a server reads it when it starts\n",
               request->dir);
    return RESULT_OK;
}

static enum result record_pose(struct knee_case *knee, const struct record_pose_request *request,
                               struct error *err) {
    struct recorded_keys record;
    pose p;
    enum result result = recorded_keys_load(request->dir, &record, err);
    if (result == RESULT_OK)
        result = present_pose(knee, request, &p, err);
    if (result == RESULT_OK)
        result = take_pose(knee, request, p, &record, err);
    return result == RESULT_OK ? save(knee, request, &record, err) : result;
}

static int run_record_pose(const struct record_pose_request *request) {
    struct knee_case *knee;
    struct error err;
    enum result result = case_load(request->dir, NULL, &knee, &err);
    if (result == RESULT_OK)
        result = record_pose(knee, request, &err);
    case_destroy(&knee);
    return result == RESULT_OK ? EXIT_OK : failed("record-pose", &err);
}

// ---- the command line ---------------------------------------------------------------------------

static enum role role_from_name(const char *name) {
    enum role role = 0;
    while (role < ROLE_COUNT && strcmp(role_names[role], name) != 0)
        role++;
    return role;
}

static int check_request(const struct record_pose_request *r) {
    if (r->role == ROLE_COUNT || !r->station || !r->socket)
        return usage_error("record-pose", "--as, --station and --socket are needed");
    if ((r->role == ROLE_REST) != !r->ligament)
        return usage_error("record-pose",
                           "--ligament goes with physical and target, and only with these");
    return EXIT_OK;
}

int command_record_pose(int argc, char **argv) {
    static const struct option options[] = {
        {"as", required_argument, NULL, 'a'},      {"ligament", required_argument, NULL, 'l'},
        {"station", required_argument, NULL, 's'}, {"socket", required_argument, NULL, 'S'},
        {"help", no_argument, NULL, 'h'},          {0}};
    struct record_pose_request request = {.role = ROLE_COUNT};
    int option;
    while ((option = getopt_long(argc, argv, "", options, NULL)) != -1) {
        if (option == 'h') {
            fputs(record_pose_help, stdout);
            return EXIT_OK;
        } else if (option == 'a') {
            request.role = role_from_name(optarg);
            if (request.role == ROLE_COUNT)
                return unknown_choice("record-pose", "--as", optarg, role_names);
        } else if (option == 'l') {
            request.ligament = optarg;
        } else if (option == 's') {
            request.station = optarg;
        } else if (option == 'S') {
            request.socket = optarg;
        } else {
            return EXIT_USAGE;
        }
    }
    if (optind + 1 != argc)
        return usage_error("record-pose", "one case folder is needed");
    request.dir = argv[optind];
    int status = check_request(&request);
    return status == EXIT_OK ? run_record_pose(&request) : status;
}
