/* Preloaded before the C library: counts the calls of the process by kind, makes one of them
 * fail, and records what is done to the files of the store and sent to clients.
 *
 *   STORE_FOLDER  absolute path; calls on other files are not counted
 *   CALL_CONTROL  file of `struct control`, shared with the test
 *   CALL_RECORD   file to which records are appended, in the order of what happened; optional
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/uio.h>
#include <unistd.h>

/* In the order of `CallKind` in calls.rs. */
enum kind { OPEN, READ, WRITE, SYNC, TRUNCATE, UNLINK, RENAME, MAP, ALLOCATE, THREAD, KINDS };

struct control {
    uint64_t kind;     /* the kind of the call that fails, */
    uint64_t number;   /* counted from 1; 0: none fails */
    uint64_t error;    /* its errno */
    uint64_t is_torn;  /* whether a write that fails writes its first half */
    uint64_t large;    /* bytes of the smallest allocation that counts; 0: none does */
    _Atomic uint64_t n_failed;
    _Atomic uint64_t n[KINDS];
};

#define PATH_BYTES 4096

static struct control *control;
static const char *folder;
static int record = -1;
/* A record must follow what it records before anything else happens. */
static pthread_mutex_t order = PTHREAD_MUTEX_INITIALIZER;

#define REAL(name) ((__typeof__(name) *)dlsym(RTLD_NEXT, #name))

__attribute__((constructor)) static void prepare(void)
{
    const char *path = getenv("CALL_CONTROL");
    int fd = path ? REAL(open)(path, O_RDWR | O_CLOEXEC) : -1;
    void *shared = mmap(NULL, sizeof *control, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    if (fd < 0 || shared == MAP_FAILED)
        abort();
    if ((path = getenv("CALL_RECORD")))
        record = REAL(open)(path, O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0600);
    folder = getenv("STORE_FOLDER");
    control = shared;
}

/* Counts a call; returns whether it is the one that fails. */
static int fails(enum kind kind)
{
    if (!control)
        return 0;
    uint64_t number = atomic_fetch_add(&control->n[kind], 1) + 1;
    if (!control->number || control->kind != kind || control->number != number)
        return 0;
    atomic_fetch_add(&control->n_failed, 1);
    errno = (int)control->error;
    return 1;
}

static int is_below_folder(const char *path)
{
    return folder && strncmp(path, folder, strlen(folder)) == 0;
}

/* Writes the path of a file of the store that is open as `fd`; returns whether it is one. */
static int is_stored(int fd, char *path)
{
    char link[64] = "/proc/self/fd/", digits[16];
    int error = errno, n = 0, at = (int)strlen(link);
    for (int rest = fd; n == 0 || rest; rest /= 10)
        digits[n++] = (char)('0' + rest % 10);
    while (n)
        link[at++] = digits[--n];
    ssize_t length = fd < 0 ? -1 : readlink(link, path, PATH_BYTES - 1);
    errno = error;
    path[length < 0 ? 0 : length] = 0;
    return length >= 0 && is_below_folder(path);
}

/* Appends a record: its kind, the lengths of path and data, a number, path and data. */
static void put(char kind, const char *path, uint64_t number, const void *data, size_t n)
{
    if (record < 0)
        return;
    int error = errno;
    uint64_t head[4] = {(uint64_t)kind, strlen(path), n, number};
    struct iovec parts[] = {{head, sizeof head}, {(void *)path, head[1]}, {(void *)data, n}};
    if (REAL(writev)(record, parts, 3) != (ssize_t)(sizeof head + head[1] + n))
        abort();
    errno = error;
}

#define IN_ORDER(statement)           \
    do {                              \
        pthread_mutex_lock(&order);   \
        statement;                    \
        pthread_mutex_unlock(&order); \
    } while (0)

static int open_stored(const char *path, int flags, mode_t mode)
{
    if (!is_below_folder(path))
        return REAL(open)(path, flags, mode);
    if (fails(OPEN))
        return -1;
    int fd;
    IN_ORDER(int is_new = access(path, F_OK) != 0; fd = REAL(open)(path, flags, mode);
             if (fd >= 0 && is_new && (flags & O_CREAT)) put('c', path, 0, NULL, 0);
             else if (fd >= 0 && (flags & O_TRUNC)) put('t', path, 0, NULL, 0));
    return fd;
}

#define OPEN_CALL(name)                                             \
    int name(const char *path, int flags, ...)                      \
    {                                                               \
        va_list more;                                               \
        va_start(more, flags);                                      \
        mode_t mode = flags & O_CREAT ? va_arg(more, mode_t) : 0;   \
        va_end(more);                                               \
        return open_stored(path, flags, mode);                      \
    }
OPEN_CALL(open)
OPEN_CALL(open64)

ssize_t read(int fd, void *data, size_t n)
{
    char path[PATH_BYTES];
    return is_stored(fd, path) && fails(READ) ? -1 : REAL(read)(fd, data, n);
}

ssize_t pread64(int fd, void *data, size_t n, off64_t at)
{
    char path[PATH_BYTES];
    return is_stored(fd, path) && fails(READ) ? -1 : REAL(pread64)(fd, data, n, at);
}

ssize_t pread(int fd, void *data, size_t n, off_t at)
{
    return pread64(fd, data, n, at);
}

static ssize_t write_stored(int fd, const char *path, const void *data, size_t n, off64_t at)
{
    int is_failing = fails(WRITE), error = errno;
    if (is_failing && !control->is_torn)
        return -1;
    ssize_t done;
    IN_ORDER(done = REAL(pwrite64)(fd, data, is_failing ? n / 2 : n, at);
             if (done > 0) put('w', path, (uint64_t)at, data, (size_t)done));
    errno = is_failing ? error : errno;
    return is_failing ? -1 : done;
}

ssize_t pwrite64(int fd, const void *data, size_t n, off64_t at)
{
    char path[PATH_BYTES];
    if (!is_stored(fd, path))
        return REAL(pwrite64)(fd, data, n, at);
    return write_stored(fd, path, data, n, at);
}

ssize_t pwrite(int fd, const void *data, size_t n, off_t at)
{
    return pwrite64(fd, data, n, at);
}

ssize_t write(int fd, const void *data, size_t n)
{
    char path[PATH_BYTES];
    if (!is_stored(fd, path))
        return REAL(write)(fd, data, n);
    off64_t at = lseek64(fd, 0, SEEK_CUR);
    ssize_t done = write_stored(fd, path, data, n, at);
    if (done > 0)
        lseek64(fd, at + done, SEEK_SET);
    return done;
}

static int sync_stored(int fd, int (*real)(int))
{
    char path[PATH_BYTES];
    if (!is_stored(fd, path))
        return real(fd);
    int result = -1;
    int is_failing = fails(SYNC), error = errno;
    /* What is not written back when a sync fails, no later sync writes. */
    IN_ORDER(if (!is_failing) result = real(fd);
             put(result == 0 ? 's' : 'x', path, 0, NULL, 0));
    errno = is_failing ? error : errno;
    return result;
}

int fsync(int fd)
{
    return sync_stored(fd, REAL(fsync));
}

int fdatasync(int fd)
{
    return sync_stored(fd, REAL(fdatasync));
}

int ftruncate64(int fd, off64_t length)
{
    char path[PATH_BYTES];
    if (!is_stored(fd, path))
        return REAL(ftruncate64)(fd, length);
    if (fails(TRUNCATE))
        return -1;
    int result;
    IN_ORDER(result = REAL(ftruncate64)(fd, length);
             if (result == 0) put('t', path, (uint64_t)length, NULL, 0));
    return result;
}

int ftruncate(int fd, off_t length)
{
    return ftruncate64(fd, length);
}

int unlink(const char *path)
{
    if (!is_below_folder(path))
        return REAL(unlink)(path);
    if (fails(UNLINK))
        return -1;
    int result;
    IN_ORDER(result = REAL(unlink)(path); if (result == 0) put('u', path, 0, NULL, 0));
    return result;
}

int rename(const char *from, const char *to)
{
    if (!is_below_folder(from))
        return REAL(rename)(from, to);
    if (fails(RENAME))
        return -1;
    int result;
    IN_ORDER(result = REAL(rename)(from, to);
             if (result == 0) put('r', from, 0, to, strlen(to)));
    return result;
}

/* A second name, of which the first one is removed next: a renaming. */
int linkat(int from_folder, const char *from, int to_folder, const char *to, int flags)
{
    if (from_folder != AT_FDCWD || to_folder != AT_FDCWD || !is_below_folder(from))
        return REAL(linkat)(from_folder, from, to_folder, to, flags);
    if (fails(RENAME))
        return -1;
    int result;
    IN_ORDER(result = REAL(linkat)(from_folder, from, to_folder, to, flags);
             if (result == 0) put('r', from, 0, to, strlen(to)));
    return result;
}

void *mmap64(void *address, size_t n, int protection, int flags, int fd, off64_t at)
{
    char path[PATH_BYTES];
    if (is_stored(fd, path) && fails(MAP))
        return MAP_FAILED;
    return REAL(mmap64)(address, n, protection, flags, fd, at);
}

void *mmap(void *address, size_t n, int protection, int flags, int fd, off_t at)
{
    return mmap64(address, n, protection, flags, fd, at);
}

/* What is sent is recorded before it can be received. */
ssize_t send(int fd, const void *data, size_t n, int flags)
{
    IN_ORDER(put('a', "", 0, data, n));
    return REAL(send)(fd, data, n, flags);
}

ssize_t writev(int fd, const struct iovec *parts, int n)
{
    int type;
    socklen_t size = sizeof type;
    int error = errno, is_socket = getsockopt(fd, SOL_SOCKET, SO_TYPE, &type, &size) == 0;
    errno = error;
    for (int i = 0; is_socket && i < n; i++)
        IN_ORDER(put('a', "", 0, parts[i].iov_base, parts[i].iov_len));
    return REAL(writev)(fd, parts, n);
}

/* Allocations; the C library exports its own under these names. */
extern void *__libc_malloc(size_t), *__libc_calloc(size_t, size_t);
extern void *__libc_realloc(void *, size_t), *__libc_memalign(size_t, size_t);

static int allocation_fails(size_t n)
{
    return control && control->large && n >= control->large && fails(ALLOCATE);
}

void *malloc(size_t n)
{
    return allocation_fails(n) ? NULL : __libc_malloc(n);
}

void *calloc(size_t n, size_t size)
{
    return allocation_fails(n * size) ? NULL : __libc_calloc(n, size);
}

void *realloc(void *old, size_t n)
{
    return allocation_fails(n) ? NULL : __libc_realloc(old, n);
}

int posix_memalign(void **result, size_t alignment, size_t n)
{
    if (allocation_fails(n))
        return ENOMEM;
    *result = __libc_memalign(alignment, n);
    return *result ? 0 : ENOMEM;
}

int pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*run)(void *),
                   void *argument)
{
    if (fails(THREAD))
        return EAGAIN;
    return REAL(pthread_create)(thread, attributes, run, argument);
}
