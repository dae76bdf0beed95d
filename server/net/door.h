// Who may hold a connection to the stations' port. Whoever has proved no certificate is a stranger.
// Strangers are few; each new one takes the place of an older one of whoever has the most, so that
// nobody keeps a station out by holding connections. A source (base/source.h) and a certificate may
// only come so often. For one thread.
#pragma once

#include "base/source.h"

#include <stdint.h>

#define DOOR_LEAVING 64              // places of connections that are being closed
#define DOOR_STRANGERS_MAX 128       // of them at a time
#define DOOR_STRANGERS_PER_SOURCE 96 // of them
#define DOOR_STATIONS_BESIDE 32      // with a certificate, beside two of each station
#define DOOR_CONNECTIONS_PER_S 100   // of one source, more than
#define DOOR_CONNECTIONS_BURST 300   // so many at once
#define DOOR_UNKNOWN_PER_S 400       // of all sources together that never proved a certificate
#define DOOR_UNKNOWN_BURST 600
#define DOOR_ENROLMENTS_BURST 10  // of one source, and one a second
#define DOOR_CERTIFICATE_MAX 4    // of them with the same one
#define DOOR_CERTIFICATE_BURST 32 // of them, and two a second
#define DOOR_SERIAL_SIZE 64

struct door;

// Of a server with so many stations: connections with a certificate, and in all.
static inline int door_stations(int stations) {
    return 2 * stations + DOOR_STATIONS_BESIDE;
}

static inline int door_places(int stations) {
    return door_stations(stations) + DOOR_STRANGERS_MAX + DOOR_LEAVING;
}

// places: at most door_places(stations); of fewer, strangers and stations have the same shares.
// shut: ends a connection that must make room. Its door_close follows, not from within the call.
struct door *door_create(int stations, int places, void (*shut)(void *connection));
void door_destroy(struct door **door);

// Whether a new connection of this source may come in; others may be shut for it. Each that comes
// in is followed by door_open.
bool door_let_in(struct door *door, const struct source *source, int64_t now_ns);
void door_open(struct door *door, void *connection, int64_t now_ns);
void door_close(struct door *door, const void *connection);

// The connection has proved the certificate of this serial number. False: too many have, or this
// one comes too often.
bool door_prove(struct door *door, const void *connection, const char *serial, int64_t now_ns);
// It stays, whatever else comes with its certificate.
void door_keep(struct door *door, const void *connection);

// Whether this stranger may try a code.
bool door_may_enrol(struct door *door, const void *connection, int64_t now_ns);

// Connections that were turned away or shut since the last call, and a source of one; 0: none.
uint64_t door_take_shut(struct door *door, struct source *out_source);
