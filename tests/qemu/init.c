// The first program of a virtual machine whose kernel has /dev/uhid: makes it a place for others,
// runs the program that its arguments name, and ends the machine with that program's exit status
// (isa-debug-exit; see machine).

#include <errno.h>
#include <fcntl.h>
#include <net/if.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <sys/io.h>
#include <sys/ioctl.h>
#include <sys/mount.h>
#include <sys/reboot.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

static void must(bool ok, const char *what) {
    if (!ok) {
        printf("%s: %s\n", what, strerror(errno));
        fflush(NULL);
        reboot(RB_POWER_OFF);
    }
}

static void load(const char *module) {
    int file = open(module, O_RDONLY | O_CLOEXEC);
    must(file >= 0 && syscall(SYS_finit_module, file, "", 0) == 0, module);
    close(file);
}

static void raise_loopback(void) {
    struct ifreq loopback = {.ifr_name = "lo", .ifr_flags = IFF_UP};
    int any = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    must(any >= 0 && !ioctl(any, SIOCSIFFLAGS, &loopback), "lo");
    close(any);
}

static void set_up_machine(void) {
    must(!mount("none", "/dev", "devtmpfs", 0, NULL), "/dev");
    int console = open("/dev/console", O_RDWR);
    must(console >= 0 && dup2(console, 1) == 1 && dup2(console, 2) == 2, "/dev/console");
    must(!mount("none", "/proc", "proc", 0, NULL), "/proc");
    must(!mount("none", "/sys", "sysfs", 0, NULL), "/sys");
    must(!mkdir("/dev/pts", 0755) && !mount("none", "/dev/pts", "devpts", 0, NULL), "/dev/pts");
    raise_loopback();
    load("/modules/hid.ko");
    load("/modules/uhid.ko");
    load("/modules/hid-generic.ko");
}

static int run(char **program) {
    int status;
    pid_t pid = fork();
    if (!pid) {
        execv(program[0], program);
        must(false, program[0]);
    }
    must(pid > 0 && waitpid(pid, &status, 0) == pid, "fork");
    return WIFEXITED(status) ? WEXITSTATUS(status) : 1;
}

int main(int argc, char **argv) {
    if (getpid() != 1 || argc < 2) {
        fputs("This program is started by tests/qemu/machine as the first of a machine.\n", stderr);
        return 2;
    }
    set_up_machine();
    int status = run(argv + 1);
    must(!ioperm(0xf4, 1, 1), "ioperm");
    outb((unsigned char)status, 0xf4);
    return 1;
}
