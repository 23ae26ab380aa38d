/* Preloaded before the C library: makes system calls on the store's files fail
 * according to the lines of the file FAULTS: "write ERRNO", "torn ERRNO" (half is
 * written), "sync ERRNO"; "clock SECONDS" shifts the wall clock. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

/* The number that FAULTS has for this fault, or 0. */
static int due(const char *what)
{
    char word[16];
    int number, found = 0;
    const char *path = getenv("FAULTS");
    FILE *file = path ? fopen(path, "r") : NULL;
    while (file && !found && fscanf(file, "%15s %d", word, &number) == 2)
        found = strcmp(word, what) ? 0 : number;
    if (file)
        fclose(file);
    return found;
}

static int is_store_file(int fd)
{
    char link[64], path[4096];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t n = readlink(link, path, sizeof path - 1);
    if (n < 0)
        return 0;
    path[n] = 0;
    return strstr(path, "offbd.sqlite") != NULL;
}

#define REAL(name) ((__typeof__(name) *)dlsym(RTLD_NEXT, #name))

/* The number of bytes of `n` to write, and the error that follows, or 0. */
static size_t allowed(int fd, size_t n, int *error)
{
    *error = 0;
    if (!is_store_file(fd))
        return n;
    if ((*error = due("write")))
        return 0;
    return (*error = due("torn")) ? n / 2 : n;
}

#define WRITE(call_all, call_part)                 \
    int error;                                     \
    size_t part = allowed(fd, n, &error);          \
    if (!error)                                    \
        return call_all;                           \
    if (part && call_part < 0)                     \
        return -1;                                 \
    errno = error;                                 \
    return -1

ssize_t write(int fd, const void *data, size_t n)
{
    WRITE(REAL(write)(fd, data, n), REAL(write)(fd, data, part));
}

ssize_t pwrite(int fd, const void *data, size_t n, off_t at)
{
    WRITE(REAL(pwrite)(fd, data, n, at), REAL(pwrite)(fd, data, part, at));
}

ssize_t pwrite64(int fd, const void *data, size_t n, off64_t at)
{
    WRITE(REAL(pwrite64)(fd, data, n, at), REAL(pwrite64)(fd, data, part, at));
}

int fsync(int fd)
{
    int error = is_store_file(fd) ? due("sync") : 0;
    if (!error)
        return REAL(fsync)(fd);
    errno = error;
    return -1;
}

int fdatasync(int fd)
{
    int error = is_store_file(fd) ? due("sync") : 0;
    if (!error)
        return REAL(fdatasync)(fd);
    errno = error;
    return -1;
}

int clock_gettime(clockid_t clock, struct timespec *now)
{
    int result = REAL(clock_gettime)(clock, now);
    if (!result && clock == CLOCK_REALTIME)
        now->tv_sec += due("clock");
    return result;
}
