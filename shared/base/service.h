// Tells the service manager that started this program how it is: systemd's protocol of
// sd_notify(3), datagrams to the socket that the environment variable NOTIFY_SOCKET names. Without
// one, nothing happens. The protocol is a few lines, so no library is linked for it.
#pragma once

// "READY=1", "STOPPING=1", "WATCHDOG=1". Never waits.
void service_notify(const char *state);
