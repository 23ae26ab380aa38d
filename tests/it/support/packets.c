/* Preloaded before the C library: the kernel loses segments that arrive at TCP sockets of the
 * process, some by chance and those of some ports all, through a filter at each socket.
 *
 *   PACKET_CONTROL  file of `struct control`, shared with the test
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/filter.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

#define MAX_PORTS 4

/* The words are numbered in packets.rs. */
struct control {
    uint64_t percent;              /* so many segments are lost by chance, */
    uint64_t ports[MAX_PORTS];     /* and all from and to these ports; 0: none */
    _Atomic uint64_t n_changed;    /* how often the above has changed, */
    _Atomic uint64_t n_applied;    /* and how many changes all sockets have */
    _Atomic uint64_t n_repeated;   /* segments that closed sockets have sent again, */
    _Atomic uint64_t n_repeated_by_open; /* and those that were open at the last change */
};

/* More than a process under test has open. */
#define MAX_FILES 4096
#define PAUSE_US 2000

static struct control *control;
/* A socket must not get a former filter after all others have got the next one. */
static pthread_mutex_t order = PTHREAD_MUTEX_INITIALIZER;

#define REAL(name) ((__typeof__(name) *)dlsym(RTLD_NEXT, #name))

static int is_tcp(int fd)
{
    int protocol = 0;
    socklen_t size = sizeof protocol;
    return getsockopt(fd, SOL_SOCKET, SO_PROTOCOL, &protocol, &size) == 0
        && protocol == IPPROTO_TCP;
}

/* Sets the filter of a socket. It sees a segment from its TCP header on. */
static void filter(int fd)
{
    struct sock_filter code[4 * MAX_PORTS + 8];
    unsigned short n = 0;
    uint32_t lost = (uint32_t)(control->percent * (UINT32_MAX / 100));
    for (uint32_t at = 0; at < 4; at += 2) {
        code[n++] = (struct sock_filter)BPF_STMT(BPF_LD | BPF_H | BPF_ABS, at);
        for (int i = 0; i < MAX_PORTS; i++) {
            uint32_t port = (uint32_t)control->ports[i];
            code[n++] = (struct sock_filter)BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, port, 0, 1);
            code[n++] = (struct sock_filter)BPF_STMT(BPF_RET | BPF_K, 0);
        }
    }
    uint32_t random = (uint32_t)(SKF_AD_OFF + SKF_AD_RANDOM);
    code[n++] = (struct sock_filter)BPF_STMT(BPF_LD | BPF_W | BPF_ABS, random);
    code[n++] = (struct sock_filter)BPF_JUMP(BPF_JMP | BPF_JGE | BPF_K, lost, 1, 0);
    code[n++] = (struct sock_filter)BPF_STMT(BPF_RET | BPF_K, 0);
    code[n++] = (struct sock_filter)BPF_STMT(BPF_RET | BPF_K, UINT32_MAX);
    struct sock_fprog program = {n, code};
    if (setsockopt(fd, SOL_SOCKET, SO_ATTACH_FILTER, &program, sizeof program) < 0)
        abort();
}

/* How many segments a socket has sent again. */
static uint64_t n_repeated(int fd)
{
    struct tcp_info info = {0};
    socklen_t size = sizeof info;
    return getsockopt(fd, IPPROTO_TCP, TCP_INFO, &info, &size) < 0 ? 0 : info.tcpi_total_retrans;
}

static void *apply_changes(void *nothing)
{
    for (;; usleep(PAUSE_US)) {
        uint64_t n_changed = control->n_changed, n_open = 0;
        if (n_changed == control->n_applied)
            continue;
        pthread_mutex_lock(&order);
        for (int fd = 0; fd < MAX_FILES; fd++) {
            if (!is_tcp(fd))
                continue;
            filter(fd);
            n_open += n_repeated(fd);
        }
        pthread_mutex_unlock(&order);
        control->n_repeated_by_open = n_open;
        control->n_applied = n_changed;
    }
    return nothing;
}

__attribute__((constructor)) static void prepare(void)
{
    const char *path = getenv("PACKET_CONTROL");
    int fd = path ? open(path, O_RDWR | O_CLOEXEC) : -1;
    void *shared = mmap(NULL, sizeof *control, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    pthread_t thread;
    if (fd < 0 || shared == MAP_FAILED)
        abort();
    control = shared;
    if (pthread_create(&thread, NULL, apply_changes, NULL))
        abort();
}

/* Gives a new descriptor, if it is a TCP socket, its filter. */
static int filtered(int fd)
{
    int error = errno;
    if (control && fd >= 0 && is_tcp(fd)) {
        pthread_mutex_lock(&order);
        filter(fd);
        pthread_mutex_unlock(&order);
    }
    errno = error;
    return fd;
}

int socket(int domain, int type, int protocol)
{
    return filtered(REAL(socket)(domain, type, protocol));
}

/* A connection has the filter that the listening socket had when it was made. */
int accept4(int listener, struct sockaddr *address, socklen_t *size, int flags)
{
    return filtered(REAL(accept4)(listener, address, size, flags));
}

int close(int fd)
{
    if (control && is_tcp(fd))
        control->n_repeated += n_repeated(fd);
    return REAL(close)(fd);
}
