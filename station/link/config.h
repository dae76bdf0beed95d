// What a link needs to know to connect.
#pragma once

#include "link/meshes.h"
#include "link/servers.h"
#include "wire/wire.h"

struct link_config {
    int server_count; // at least 1
    struct server_address servers[SERVERS_MAX];
    const char *keys_dir; // station.key, station.pem, authority.pem (link_enrol makes them)
    const char *station;
    const char *software;
    bool datagrams;                 // false: frames always travel in the control connection
    bool meshes;                    // follow those that are cut
    meshes_changed *meshes_changed; // NULL is fine; also for those that end with the link
    void *meshes_user;
    bool markers; // it has some: the log tells of a server that takes none
    bool visit;   // only asks whether it would be welcome: no session, link_send sends nothing
    struct instruments instruments; // those beyond the usual ones are described to the server
    int device_count;
    arthron_Device devices[16];
    bool calibrated;
    arthron_Calibration calibration;
};
