#include "link/trouble.h"

#include <stddef.h>
#include <string.h>

const char *trouble_sentence(const char *reason) {
    static const struct {
        const char *part, *sentence; // the part is libwebsockets'
    } rows[] = {
        {"Unable to connect",
         "nobody answers there. Is the server running, and are host, port and network right?"},
        {"conn fail",
         "nobody answers there. Is the server running, and are host, port and network right?"},
        {"Timed out",
         "the connection is accepted, but nothing is answered. Does the server hang, or is this "
         "another program's port?"},
        {"SYSCALL", "the connection is closed at once. Is this the server's port for stations?"},
        {"connect SSL", "what answers there does not speak TLS as the server does. Is this the "
                        "server's port for stations?"},
        {"not 101", "what answers there is no server for stations. Is the port right? It is not "
                    "the one of the pages"},
        {"HS:", "what answers there is no server for stations. Is the port right? It is not the "
                "one of the pages"},
        {"read failed",
         "the server closed the connection before it said Welcome. Its log may tell why"},
        {"Closed before conn",
         "the server closed the connection before it said Welcome. Its log may tell why"},
    };
    if (!reason)
        return "the name leads to no address. Is it spelt right, and does the name server answer?";
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++)
        if (strstr(reason, rows[i].part))
            return rows[i].sentence;
    return "there is no connection. Is the server running, and are host, port and network right?";
}
