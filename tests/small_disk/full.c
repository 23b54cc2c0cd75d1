/* Stands before the C library (LD_PRELOAD) and makes the folder $DISK a full disk: while the file "ballast" is in it, no
 * more bytes than the number in that file can be written below it. As on a real disk, what still fits is written. */

#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

static atomic_llong written;

static int is_below_disk(const char *path) {
    const char *disk = getenv("DISK");
    return disk && !strncmp(path, disk, strlen(disk)) && path[strlen(disk)] == '/';
}

static int is_on_disk(int fd) {
    char link[64], path[PATH_MAX] = {0};
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    return readlink(link, path, sizeof path - 1) > 0 && is_below_disk(path);
}

/* How many of `wanted` bytes fit. */
static size_t fitting(int fd, size_t wanted) {
    if (!is_on_disk(fd)) return wanted;
    char path[PATH_MAX], text[32] = {0};
    snprintf(path, sizeof path, "%s/ballast", getenv("DISK"));
    int ballast = open(path, O_RDONLY);
    if (ballast < 0) return wanted;
    ssize_t length = read(ballast, text, sizeof text - 1);
    close(ballast);
    long long room = (length > 0 ? atoll(text) : 0) - atomic_fetch_add(&written, (long long)wanted);
    if (room >= (long long)wanted) return wanted;
    size_t fits = room > 0 ? (size_t)room : 0;
    atomic_fetch_sub(&written, (long long)(wanted - fits));
    return fits;
}

#define NEXT(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

ssize_t write(int fd, const void *bytes, size_t count) {
    size_t fits = fitting(fd, count);
    if (count > 0 && fits == 0) return errno = ENOSPC, -1;
    return NEXT(write)(fd, bytes, fits);
}

ssize_t writev(int fd, const struct iovec *parts, int count) {
    /* One part of several is a short write, which every caller must expect. */
    return count > 0 ? write(fd, parts[0].iov_base, parts[0].iov_len) : 0;
}

static ssize_t at(int fd, const void *bytes, size_t count, off_t offset) {
    size_t fits = fitting(fd, count);
    if (count > 0 && fits == 0) return errno = ENOSPC, -1;
    return NEXT(pwrite)(fd, bytes, fits, offset);
}

ssize_t pwrite(int fd, const void *bytes, size_t count, off_t offset) { return at(fd, bytes, count, offset); }

ssize_t pwrite64(int fd, const void *bytes, size_t count, off64_t offset) { return at(fd, bytes, count, offset); }

/* What is deleted makes room. */
int unlink(const char *path) {
    struct stat found;
    long long bytes = is_below_disk(path) && !stat(path, &found) ? found.st_size : 0;
    int result = NEXT(unlink)(path);
    if (result == 0) atomic_fetch_sub(&written, bytes);
    return result;
}
