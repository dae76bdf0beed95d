// What is told of sessions to those who ask.
#include "base/clock.h"
#include "hub/grades.h"
#include "hub/reply.h"
#include "hub/seat.h"
#include "net/authority.h"

#include <time.h>

#define FIGURES_WAIT_MS 5000

static void show_joint(struct hub *hub, int index, arthron_CommandReply *reply) {
    struct moment moment;
    seat_moment(hub, index, &moment);
    reply->has_joint = seat_has_session(&hub->seats[index]) && moment.step > 0;
    if (!reply->has_joint)
        return;
    const pose *bodies = moment.T_mockup_body;
    pose T_femur_tibia = pose_compose(pose_inverse(bodies[BODY_FEMUR]), bodies[BODY_TIBIA]);
    reply->joint = (arthron_JointReading){
        .step = moment.step,
        .time_ns = moment.time_ns,
        .validity = (arthron_Validity)moment.joint_validity,
        .has_joint = true,
        .joint = wire_joint_from(&moment.joint),
        .has_pose = true,
        .pose = wire_pose_from(T_femur_tibia),
    };
}

// A session that has just begun, or goes on, is in its theatre's hands before its figures are told.
static bool wait_for_card(struct hub *hub, int index, struct card *out) {
    const struct timespec pause = {0, 5 * NS_PER_MS};
    struct seat *seat = &hub->seats[index];
    for (int waited = 0; waited < FIGURES_WAIT_MS; waited += 5) {
        pthread_mutex_lock(&hub->card_lock);
        *out = seat->card;
        pthread_mutex_unlock(&hub->card_lock);
        bool told = out->about.session && out->figures_of == out->about.session;
        if (told || !seat_has_session(seat))
            return true;
        nanosleep(&pause, NULL);
    }
    return false;
}

void listing_seat(struct hub *hub, int index, arthron_CommandReply *reply) {
    struct card card;
    if (!wait_for_card(hub, index, &card)) {
        reply_refuse(reply, "station %s: its theatre is too busy to tell",
                     hub->seats[index].station->name);
        return;
    }
    reply->ok = true;
    const struct scene *scene = hub->scenes[card.scene];
    seat_info(hub, index, &reply->sessions[0]);
    reply->sessions_count = 1;
    reply->resections_count = (pb_size_t)scene_tissue_count(scene);
    for (int i = 0; i < scene_tissue_count(scene); i++)
        reply_resection(&card.tissues[i],
                        scene_case(scene)->groups[scene_tissue_group(scene, i)].name,
                        card.mesh_hashes[i], &reply->resections[i]);
    show_joint(hub, index, reply);
}

static void list_refused(struct hub *hub, arthron_Refused *out) {
    for (int i = 0; i < hub->worker_count; i++) {
        const struct worker_counts *counts = &hub->workers[i].counts;
        out->strangers += atomic_load(&counts->strangers);
        out->forged += atomic_load(&counts->forged);
        out->replayed += atomic_load(&counts->replayed);
        out->malformed += atomic_load(&counts->malformed);
        out->too_long += atomic_load(&counts->too_long);
    }
    struct control_counts control = control_counts(hub->control);
    out->certificates = control.refused_certificates;
    out->control_malformed = control.malformed_messages;
    out->control_unknown = control.unknown_messages;
    out->replies_dropped = control.replies_dropped;
}

void listing_all(struct hub *hub, arthron_CommandReply *reply) {
    struct authority_server server;
    authority_server(hub->config.keys_dir, &server, NULL);
    reply->certificate_until_utc_s = server.until_utc_s;
    reply->has_refused = true;
    grades_refresh(hub->grades);
    list_refused(hub, &reply->refused);
    for (int i = 0; i < hub->config.station_count; i++)
        seat_info(hub, i, &reply->sessions[reply->sessions_count++]);
    reply->ok = true;
}
