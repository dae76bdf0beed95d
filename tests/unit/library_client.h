// An OpenIGTLink client made of the library's own classes. The library speaks header version 1; for
// the others the client takes off what version 2 put around the content, and puts it on.
#pragma once

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

struct library_client;

#define LIBRARY_TOOLS_MAX 24

struct library_tool {
    char name[21];
    int type;
    float position[3];
    float matrix[3][3];  // TRANSFORM, TDATA
    float quaternion[4]; // QTDATA: x, y, z, w
};

struct library_message {
    char type[13], device[21];
    int version; // of its header
    int64_t stamp_ns;
    bool read; // the library could read it, its checksum too
    int tool_count;
    struct library_tool tools[LIBRARY_TOOLS_MAX];
    char text[256]; // STRING, STATUS
    int status;     // STATUS, RTS_
    int point_count, triangle_count;
    const float *points;       // three for each; of the client
    const uint32_t *triangles; // three for each; of the client
};

// Connects, and reads all that comes in a thread of its own; NULL: it cannot connect.
struct library_client *library_client_start(int port);
// Connects, and never reads.
struct library_client *library_client_start_deaf(int port);
// Until the server has closed the connection, and all that it sent is read.
void library_client_wait(struct library_client *client);
void library_client_end(struct library_client *client); // waits, too

// Sends a request of the given header version. An interval of 0 is for GET_, STP_.
bool library_client_ask(struct library_client *client, int version, const char *type,
                        const char *device, int interval_ms);

// Messages so far, in the order in which they came.
int library_client_count(struct library_client *client);
struct library_message library_client_message(struct library_client *client, int i);

#ifdef __cplusplus
}
#endif
