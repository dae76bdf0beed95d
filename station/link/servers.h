// Which server a station tries next, and after how long: its list in turn, and where servers send
// it. Plain state of one thread: no sockets, no clock.
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define SERVERS_MAX 8
#define SERVERS_FOLLOWED_MAX 4 // in a row
#define SERVERS_ASKED_MAX 8    // the same one in a row
#define SERVERS_BACK_OFF (-1)  // all were tried: wait longer each time
#define SERVERS_SESSIONS 8     // whose tokens are remembered
#define SERVER_TEXT_SIZE 264   // host, brackets, port

struct server_address {
    char host[256];
    int port;
};

struct servers {
    int count;
    struct server_address list[SERVERS_MAX + 1]; // the last one is where a server sent it
    int present;
    int first;               // of the list: the last one that answered
    unsigned tried, silent;  // bits of the list, since the last good connection or back-off
    int named_by;            // the one of the list that named the present one; -1: none did
    int followed, asked;     // in a row
    int64_t welcomed_ns;     // 0: the present one has not welcomed us
    int session_count, next; // next: the place of the next session
    struct {
        uint8_t id[16];
        uint64_t token;
    } sessions[SERVERS_SESSIONS];
};

// "host:port" or "[address]:port"; false where it is not that.
bool server_parse(const char *text, struct server_address *out);
void server_write(const struct server_address *server, char out[SERVER_TEXT_SIZE]);

// Up to SERVERS_MAX of them, between commas. Returns how many; 0: it is not that.
int servers_parse(const char *text, struct server_address out[SERVERS_MAX]);

void servers_init(struct servers *servers, const struct server_address *list, int count);

// The one to connect to.
const struct server_address *servers_present(const struct servers *servers);

// Whether there is another one, so that a silent one is soon given up.
bool servers_has_other(const struct servers *servers);

// False: it has an old state of its session, and is to be left. A token is remembered with its
// session, and 0 is none.
bool servers_welcomed(struct servers *servers, const uint8_t session_id[16], uint64_t token,
                      int64_t now_ns);

// Each of these returns after how many ms to connect to servers_present, or SERVERS_BACK_OFF.

// The present one cannot be reached, refuses, or its connection ended. A silent one is not followed
// to again before all others were tried.
int servers_lost(struct servers *servers, bool was_silent, int64_t now_ns);

// It names another one; NULL: in words that are no address. One that cannot be reached is asked for
// again, since somebody will take the session.
int servers_elsewhere(struct servers *servers, const struct server_address *to, int64_t now_ns);

// It wants to be asked again.
int servers_ask_again(struct servers *servers, uint32_t after_ms, int64_t now_ns);
