/* Preloaded before the C library: makes system calls on the store's files fail
 * according to the lines of the file FAULTS: "write ERRNO", "torn ERRNO" (half is
 * written), "sync ERRNO", "room BYTES" (all that the store's files have on the disk);
 * "clock SECONDS" shifts the wall clock. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <glob.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
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

#define STORE "offbd.sqlite"

/* The path of a file, up to the name of the store; or NULL if it is not the store's. */
static char *store_file(int fd, char *path, size_t size)
{
    char link[64];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t n = readlink(link, path, size - 1);
    if (n < 0)
        return NULL;
    path[n] = 0;
    char *name = strstr(path, STORE);
    if (!name)
        return NULL;
    name[strlen(STORE)] = 0;
    return path;
}

static int is_store_file(int fd)
{
    char path[4096];
    return store_file(fd, path, sizeof path) != NULL;
}

/* Whether a file has no room for `end` bytes. */
static int is_full(int fd, off_t end)
{
    int room = due("room");
    char path[4090];
    struct stat file, other;
    if (!room || !store_file(fd, path, sizeof path) || fstat(fd, &file) || end <= file.st_size)
        return 0;
    off_t used = end - file.st_size;
    glob_t files;
    strcat(path, "*");
    if (glob(path, 0, NULL, &files))
        return 0;
    for (size_t i = 0; i < files.gl_pathc; i++)
        used += stat(files.gl_pathv[i], &other) ? 0 : other.st_size;
    globfree(&files);
    return used > room;
}

#define REAL(name) ((__typeof__(name) *)dlsym(RTLD_NEXT, #name))

/* The number of bytes of `n` to write at `at`, and the error that follows, or 0. */
static size_t allowed(int fd, size_t n, off_t at, int *error)
{
    *error = 0;
    if (!is_store_file(fd))
        return n;
    if ((*error = due("write")) || (*error = is_full(fd, at + (off_t)n) ? ENOSPC : 0))
        return 0;
    return (*error = due("torn")) ? n / 2 : n;
}

#define WRITE(at, call_all, call_part)             \
    int error;                                     \
    size_t part = allowed(fd, n, at, &error);      \
    if (!error)                                    \
        return call_all;                           \
    if (part && call_part < 0)                     \
        return -1;                                 \
    errno = error;                                 \
    return -1

ssize_t write(int fd, const void *data, size_t n)
{
    WRITE(lseek(fd, 0, SEEK_CUR), REAL(write)(fd, data, n), REAL(write)(fd, data, part));
}

ssize_t pwrite(int fd, const void *data, size_t n, off_t at)
{
    WRITE(at, REAL(pwrite)(fd, data, n, at), REAL(pwrite)(fd, data, part, at));
}

ssize_t pwrite64(int fd, const void *data, size_t n, off64_t at)
{
    WRITE(at, REAL(pwrite64)(fd, data, n, at), REAL(pwrite64)(fd, data, part, at));
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
