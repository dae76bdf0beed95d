#include "failing.h"

#include <netdb.h>
#include <pwd.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

CALL(SOCKET, -1, int, socket, (int domain, int type, int protocol), (domain, type, protocol))
CALL(SOCKET, -1, int, socketpair, (int domain, int type, int protocol, int fds[2]),
     (domain, type, protocol, fds))
CALL(BIND, -1, int, bind, (int fd, const struct sockaddr *address, socklen_t size),
     (fd, address, size))
CALL(LISTEN, -1, int, listen, (int fd, int backlog), (fd, backlog))
CALL(ACCEPT, -1, int, accept, (int fd, struct sockaddr *restrict address, socklen_t *restrict size),
     (fd, address, size))
CALL(ACCEPT, -1, int, accept4,
     (int fd, struct sockaddr *restrict address, socklen_t *restrict size, int flags),
     (fd, address, size, flags))
CALL(CONNECT, -1, int, connect, (int fd, const struct sockaddr *address, socklen_t size),
     (fd, address, size))

CALL(RECEIVE, -1, ssize_t, recv, (int fd, void *data, size_t size, int flags),
     (fd, data, size, flags))
CALL(RECEIVE, -1, ssize_t, recvfrom,
     (int fd, void *restrict data, size_t size, int flags, struct sockaddr *restrict address,
      socklen_t *restrict length),
     (fd, data, size, flags, address, length))
CALL(RECEIVE, -1, ssize_t, recvmsg, (int fd, struct msghdr *message, int flags),
     (fd, message, flags))
CALL(RECEIVE, -1, int, recvmmsg,
     (int fd, struct mmsghdr *messages, unsigned count, int flags, struct timespec *timeout),
     (fd, messages, count, flags, timeout))
CALL(SEND, -1, ssize_t, send, (int fd, const void *data, size_t size, int flags),
     (fd, data, size, flags))
CALL(SEND, -1, ssize_t, sendto,
     (int fd, const void *data, size_t size, int flags, const struct sockaddr *address,
      socklen_t length),
     (fd, data, size, flags, address, length))
CALL(SEND, -1, ssize_t, sendmsg, (int fd, const struct msghdr *message, int flags),
     (fd, message, flags))
CALL(SEND, -1, int, sendmmsg, (int fd, struct mmsghdr *messages, unsigned count, int flags),
     (fd, messages, count, flags))

CALL(OPTION, -1, int, setsockopt, (int fd, int level, int name, const void *value, socklen_t size),
     (fd, level, name, value, size))
CALL(OPTION, -1, int, getsockopt,
     (int fd, int level, int name, void *restrict value, socklen_t *restrict size),
     (fd, level, name, value, size))
CALL(OPTION, -1, int, getsockname,
     (int fd, struct sockaddr *restrict address, socklen_t *restrict size), (fd, address, size))
CALL(OPTION, -1, int, getpeername,
     (int fd, struct sockaddr *restrict address, socklen_t *restrict size), (fd, address, size))
CALL(OPTION, -1, int, shutdown, (int fd, int how), (fd, how))

CALL(RESOLVE, EAI_MEMORY, int, getaddrinfo,
     (const char *restrict host, const char *restrict service,
      const struct addrinfo *restrict hints, struct addrinfo **restrict out),
     (host, service, hints, out))
CALL(RESOLVE, EAI_MEMORY, int, getnameinfo,
     (const struct sockaddr *restrict address, socklen_t size, char *restrict host,
      socklen_t host_size, char *restrict service, socklen_t service_size, int flags),
     (address, size, host, host_size, service, service_size, flags))
CALL(RESOLVE, -1, int, gethostname, (char *out, size_t size), (out, size))
CALL(RESOLVE, NULL, struct passwd *, getpwuid, (uid_t user), (user))

int getpwuid_r(uid_t user, struct passwd *restrict out, char *restrict text, size_t size,
               struct passwd **restrict out_found) {
    REAL(getpwuid_r);
    if (!FAILS(RESOLVE))
        return real(user, out, text, size, out_found);
    *out_found = NULL;
    return ENOMEM;
}
