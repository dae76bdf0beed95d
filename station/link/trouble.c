#include "link/trouble.h"

#include <stddef.h>
#include <string.h>

const char *trouble_sentence(const char *reason) {
    static const struct {
        const char *part, *sentence; // the part is libwebsockets'
    } rows[] = {
        {"Unable to connect",
         "no server answers. Check that it runs, and check host, port and network"},
        {"conn fail", "no server answers. Check that it runs, and check host, port and network"},
        {"Timed out", "the server accepted the connection but does not answer. Check the port, and "
                      "the server's log"},
        {"SYSCALL",
         "the connection was closed at once. Check that this is the server's port for stations"},
        {"connect SSL", "the program at this port does not speak TLS. Check that this is the "
                        "server's port for stations"},
        {"not 101", "the program at this port does not serve stations. Use the port for stations, "
                    "not that of the pages"},
        {"HS:", "the program at this port does not serve stations. Use the port for stations, not "
                "that of the pages"},
        {"read failed", "the server closed the connection before its Welcome. Its log may say why"},
        {"Closed before conn",
         "the server closed the connection before its Welcome. Its log may say why"},
    };
    if (!reason)
        return "the host name has no address. Check its spelling and the name server";
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++)
        if (strstr(reason, rows[i].part))
            return rows[i].sentence;
    return "the connection failed. Check that the server runs, and check host, port and network";
}
