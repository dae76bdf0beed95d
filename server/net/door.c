#include "net/door.h"

#include "base/bucket.h"
#include "base/check.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define SOURCES_BESIDE 672  // more than places, to remember sources without a connection
#define CERTIFICATES_EACH 4 // of a station
#define ENROLMENTS_PER_S 1
#define CERTIFICATE_PER_S 2

struct visitor { // of the port: a source
    struct source source;
    bool known, has_proved;
    int connections, strangers;
    struct bucket comes, enrols;
    int64_t seen_ns;
};

struct certificate {
    char serial[DOOR_SERIAL_SIZE];
    struct bucket comes;
    int64_t seen_ns;
};

struct place {
    void *connection; // NULL: free
    struct visitor *visitor;
    int64_t since_ns;
    bool proved, kept, leaves;
    char serial[DOOR_SERIAL_SIZE]; // of its certificate, once proved
};

struct door {
    void (*shut)(void *connection);
    int places_max, strangers_max, per_source, stations_max;
    int strangers, stations;
    struct visitor *next; // of door_open
    struct bucket unknown;
    uint64_t shut_count;
    struct source shut_source;
    int visitor_count, certificate_count;
    struct visitor *visitors;
    struct certificate *certificates;
    struct place *places;
};

static int share(int of_all, int places, int all) {
    return (int)(((int64_t)of_all * places + all - 1) / all);
}

struct door *door_create(int stations, int places, void (*shut)(void *connection)) {
    int all = door_places(stations);
    CHECK(places > 0 && places <= all);
    struct door *door = alloc(1, sizeof *door);
    door->shut = shut;
    door->places_max = places;
    door->strangers_max = share(DOOR_STRANGERS_MAX, places, all);
    door->per_source = share(DOOR_STRANGERS_PER_SOURCE, places, all);
    door->stations_max = share(door_stations(stations), places, all);
    door->visitor_count = places + SOURCES_BESIDE;
    door->certificate_count = CERTIFICATES_EACH * (stations + 1);
    door->visitors = alloc((size_t)door->visitor_count, sizeof *door->visitors);
    door->certificates = alloc((size_t)door->certificate_count, sizeof *door->certificates);
    door->places = alloc((size_t)places, sizeof *door->places);
    return door;
}

void door_destroy(struct door **door) {
    if (*door) {
        free((*door)->visitors);
        free((*door)->certificates);
        free((*door)->places);
    }
    free(*door);
    *door = NULL;
}

// ---- places -------------------------------------------------------------------------------------

static struct place *find_place(struct door *door, const void *connection) {
    for (int i = 0; i < door->places_max; i++)
        if (door->places[i].connection == connection)
            return &door->places[i];
    return NULL;
}

static bool is_stranger(const struct place *place) {
    return place->connection && !place->proved && !place->leaves;
}

static void count_shut(struct door *door, const struct source *source) {
    door->shut_count++;
    door->shut_source = *source;
}

static void leave_place(struct door *door, struct place *place) {
    if (is_stranger(place)) {
        door->strangers--;
        place->visitor->strangers--;
    }
    door->stations -= place->proved && !place->leaves;
    place->leaves = true;
}

static void shut_place(struct door *door, struct place *place) {
    leave_place(door, place);
    count_shut(door, &place->visitor->source);
    door->shut(place->connection);
}

// ---- sources ------------------------------------------------------------------------------------

// The one that was gone longest; one that was never used before any other.
static struct visitor *place_for_visitor(struct door *door) {
    struct visitor *best = NULL;
    for (int i = 0; i < door->visitor_count; i++) {
        struct visitor *v = &door->visitors[i];
        if (!v->connections && (!best || v->seen_ns < best->seen_ns))
            best = v;
    }
    return best;
}

static struct visitor *find_visitor(struct door *door, const struct source *source) {
    for (int i = 0; i < door->visitor_count; i++)
        if (door->visitors[i].known && source_is(&door->visitors[i].source, source))
            return &door->visitors[i];
    struct visitor *visitor = place_for_visitor(door);
    *visitor = (struct visitor){.source = *source, .known = true};
    return visitor;
}

static bool comes_too_often(struct door *door, struct visitor *visitor, int64_t now_ns) {
    if (!bucket_take(&visitor->comes, DOOR_CONNECTIONS_PER_S, DOOR_CONNECTIONS_BURST, now_ns))
        return true;
    return !visitor->has_proved &&
           !bucket_take(&door->unknown, DOOR_UNKNOWN_PER_S, DOOR_UNKNOWN_BURST, now_ns);
}

static struct visitor *most_strangers(struct door *door) {
    struct visitor *most = NULL;
    for (int i = 0; i < door->visitor_count; i++) {
        struct visitor *v = &door->visitors[i];
        if (v->strangers && (!most || v->strangers > most->strangers))
            most = v;
    }
    return most;
}

static void shut_oldest_stranger_of(struct door *door, const struct visitor *visitor) {
    struct place *oldest = NULL;
    for (int i = 0; i < door->places_max; i++) {
        struct place *place = &door->places[i];
        if (is_stranger(place) && place->visitor == visitor &&
            (!oldest || place->since_ns < oldest->since_ns))
            oldest = place;
    }
    shut_place(door, oldest);
}

// ---- strangers ----------------------------------------------------------------------------------

bool door_let_in(struct door *door, const struct source *source, int64_t now_ns) {
    struct visitor *visitor = find_visitor(door, source);
    visitor->seen_ns = now_ns;
    door->next = NULL;
    if (comes_too_often(door, visitor, now_ns) || !find_place(door, NULL)) {
        count_shut(door, source);
        return false;
    }
    if (visitor->strangers >= door->per_source)
        shut_oldest_stranger_of(door, visitor);
    else if (door->strangers >= door->strangers_max)
        shut_oldest_stranger_of(door, most_strangers(door));
    door->next = visitor;
    return true;
}

void door_open(struct door *door, void *connection, int64_t now_ns) {
    struct place *place = find_place(door, NULL);
    if (!door->next)
        return;
    *place = (struct place){.connection = connection, .visitor = door->next, .since_ns = now_ns};
    door->strangers++;
    door->next->strangers++;
    door->next->connections++;
    door->next = NULL;
}

void door_close(struct door *door, const void *connection) {
    struct place *place = find_place(door, connection);
    if (!place)
        return;
    leave_place(door, place);
    place->visitor->connections--;
    place->connection = NULL;
}

bool door_may_enrol(struct door *door, const void *connection, int64_t now_ns) {
    struct place *place = find_place(door, connection);
    return place &&
           bucket_take(&place->visitor->enrols, ENROLMENTS_PER_S, DOOR_ENROLMENTS_BURST, now_ns);
}

// ---- certificates -------------------------------------------------------------------------------

static struct certificate *find_certificate(struct door *door, const char *serial) {
    struct certificate *oldest = &door->certificates[0];
    for (int i = 0; i < door->certificate_count; i++) {
        struct certificate *c = &door->certificates[i];
        if (!strcmp(c->serial, serial))
            return c;
        if (c->seen_ns < oldest->seen_ns)
            oldest = c;
    }
    *oldest = (struct certificate){0};
    snprintf(oldest->serial, sizeof oldest->serial, "%s", serial);
    return oldest;
}

// Where a certificate has more connections than it may, its oldest that is not kept makes room.
static void make_room_for(struct door *door, const char *serial) {
    struct place *oldest = NULL;
    int count = 0;
    for (int i = 0; i < door->places_max; i++) {
        struct place *place = &door->places[i];
        if (!place->connection || !place->proved || place->leaves ||
            strcmp(place->serial, serial) != 0)
            continue;
        count++;
        if (!place->kept && (!oldest || place->since_ns < oldest->since_ns))
            oldest = place;
    }
    if (count >= DOOR_CERTIFICATE_MAX && oldest)
        shut_place(door, oldest);
}

bool door_prove(struct door *door, const void *connection, const char *serial, int64_t now_ns) {
    struct place *place = find_place(door, connection);
    struct certificate *certificate = find_certificate(door, serial);
    certificate->seen_ns = now_ns;
    if (!place || place->leaves)
        return false;
    place->visitor->has_proved = true;
    if (!bucket_take(&certificate->comes, CERTIFICATE_PER_S, DOOR_CERTIFICATE_BURST, now_ns))
        return false;
    make_room_for(door, serial);
    if (door->stations >= door->stations_max)
        return false;
    door->strangers--;
    place->visitor->strangers--;
    door->stations++;
    place->proved = true;
    snprintf(place->serial, sizeof place->serial, "%s", serial);
    return true;
}

void door_keep(struct door *door, const void *connection) {
    struct place *place = find_place(door, connection);
    if (place)
        place->kept = true;
}

uint64_t door_take_shut(struct door *door, struct source *out_source) {
    uint64_t count = door->shut_count;
    *out_source = door->shut_source;
    door->shut_count = 0;
    return count;
}
