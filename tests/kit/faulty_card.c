/* Preloaded, this makes the files below $CARD fail as told, and writes down what is done to them.

   $CARD_FAULTS names a file with lines "operation errno"; it may be changed at any time.
   $CARD_TRACE names a file that gets every operation: header, name, data.
   $CARD_KILL_AT kills the process before the nth operation, from 1.
   $CARD_BAD_AT is the offset of a byte that no journal gives. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/syscall.h>
#include <unistd.h>

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

struct header { char operation[12]; uint32_t name_length; uint32_t length; uint64_t offset; };

static int counted;

static int on_card(const char *path) {
    const char *card = getenv("CARD");
    return card && strncmp(path, card, strlen(card)) == 0;
}

static int path_of(int fd, char *path, size_t size) {
    char link[64];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t n = readlink(link, path, size - 1);
    path[n < 0 ? 0 : n] = 0;
    return n > 0 && on_card(path);
}

/* raw system calls: nothing in here may come back to the functions below */
static int told_errno(const char *operation) {
    const char *name = getenv("CARD_FAULTS");
    char text[512], *line, *rest = text;
    int fd = name ? syscall(SYS_openat, AT_FDCWD, name, O_RDONLY, 0) : -1;
    if (fd < 0) return 0;
    long n = syscall(SYS_read, fd, text, sizeof text - 1);
    syscall(SYS_close, fd);
    text[n < 0 ? 0 : n] = 0;
    while ((line = strsep(&rest, "\n"))) {
        char told[32];
        int number;
        if (sscanf(line, "%31s %d", told, &number) == 2 && strcmp(told, operation) == 0) return number;
    }
    return 0;
}

static int refused(const char *operation, const char *path, const void *data, uint32_t length, uint64_t offset) {
    const char *trace = getenv("CARD_TRACE"), *kill_at = getenv("CARD_KILL_AT");
    int error = told_errno(operation);
    if (++counted == (kill_at ? atoi(kill_at) : -1)) syscall(SYS_kill, getpid(), SIGKILL);
    if (trace && !error) {
        struct header header = {.name_length = strlen(path), .length = length, .offset = offset};
        strncpy(header.operation, operation, sizeof header.operation - 1);
        int fd = syscall(SYS_openat, AT_FDCWD, trace, O_WRONLY | O_CREAT | O_APPEND, 0600);
        syscall(SYS_write, fd, &header, sizeof header);
        syscall(SYS_write, fd, path, header.name_length);
        if (data) syscall(SYS_write, fd, data, length);
        syscall(SYS_close, fd);
    }
    errno = error;
    return error;
}

#define OPEN(name)                                                                                    \
    int name(const char *path, int flags, ...) {                                                      \
        va_list more;                                                                                 \
        va_start(more, flags);                                                                        \
        int mode = va_arg(more, int);                                                                 \
        va_end(more);                                                                                 \
        if ((flags & O_CREAT) && on_card(path) && refused("create", path, 0, 0, 0)) return -1;        \
        return REAL(name)(path, flags, mode);                                                         \
    }
OPEN(open)
OPEN(open64)

#define PWRITE(name)                                                                                  \
    ssize_t name(int fd, const void *data, size_t length, off_t offset) {                             \
        char path[4096];                                                                              \
        if (path_of(fd, path, sizeof path) && refused("pwrite", path, data, length, offset)) return -1; \
        return REAL(name)(fd, data, length, offset);                                                  \
    }
PWRITE(pwrite)
PWRITE(pwrite64)

#define PREAD(name)                                                                                   \
    ssize_t name(int fd, void *data, size_t length, off_t offset) {                                   \
        char path[4096], *bad = getenv("CARD_BAD_AT");                                                \
        int covers = bad && offset <= atoll(bad) && atoll(bad) < offset + (off_t)length;              \
        if (covers && path_of(fd, path, sizeof path) && strstr(path, ".journal")) {                   \
            errno = EIO;                                                                              \
            return -1;                                                                                \
        }                                                                                             \
        return REAL(name)(fd, data, length, offset);                                                  \
    }
PREAD(pread)
PREAD(pread64)

#define SYNC(name)                                                                                    \
    int name(int fd) {                                                                                \
        char path[4096];                                                                              \
        if (path_of(fd, path, sizeof path) && refused(#name, path, 0, 0, 0)) return -1;               \
        return REAL(name)(fd);                                                                        \
    }
SYNC(fsync)
SYNC(fdatasync)

#define TRUNCATE(name)                                                                                \
    int name(int fd, off_t length) {                                                                  \
        char path[4096];                                                                              \
        if (path_of(fd, path, sizeof path) && refused("ftruncate", path, 0, 0, length)) return -1;    \
        return REAL(name)(fd, length);                                                                \
    }
TRUNCATE(ftruncate)
TRUNCATE(ftruncate64)

int rename(const char *from, const char *to) {
    if (on_card(to) && refused("rename", to, 0, 0, 0)) return -1;
    return REAL(rename)(from, to);
}
