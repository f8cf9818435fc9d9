/* Virtual clock and own ports for a firmware that runs as a process.
 *
 * Preloaded into the firmware, it replaces the monotonic clock, sleep and socket ports:
 * - Time goes on only as far as the simulator grants it. The main thread waits in its own sleep, and says so.
 * - Before it goes on, the datagrams that were sent with the grant have been dealt with: their threads ask for the next.
 * - One thread runs at a time: the others while the main thread waits for time, up to their next call of select. The
 *   firmware's own server of its command line is not safe among threads.
 * - Every port is moved by an offset, and listens on the loopback interface alone.
 * - The process ends once the simulator has, whose end of the pipe is then closed.
 *
 * Environment: NP_DRAKE_GRANTS (descriptor: grants in, uint64 nanoseconds and uint64 datagrams), NP_DRAKE_EVENTS
 * (descriptor: one byte out whenever granted time is used up), NP_DRAKE_PORT_OFFSET.
 */
#define _GNU_SOURCE
#include <arpa/inet.h>
#include <dlfcn.h>
#include <errno.h>
#include <netinet/in.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/select.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#define LOOK_NS 100 /* that a look at the clock costs the main thread, so that a loop which waits for a time ends */

static int grants = -1, events = -1, offset = 0;
static _Atomic uint64_t now = 1000000000;
static uint64_t granted = 1000000000;
static sem_t dealt_with; /* datagrams */
static pthread_mutex_t turn = PTHREAD_MUTEX_INITIALIZER;
static _Thread_local int is_main = 0, took = 0, runs = 0; /* runs: has its turn */

static void begin_turn(void)
{
    if (grants >= 0 && !runs)
        runs = pthread_mutex_lock(&turn) == 0;
}

static void end_turn(void)
{
    if (runs)
        runs = pthread_mutex_unlock(&turn) != 0;
}

__attribute__((constructor)) static void begin(void)
{
    const char *in = getenv("NP_DRAKE_GRANTS"), *out = getenv("NP_DRAKE_EVENTS"), *moved = getenv("NP_DRAKE_PORT_OFFSET");
    if (!in || !out)
        return;
    grants = atoi(in), events = atoi(out), offset = moved ? atoi(moved) : 0;
    is_main = 1;
    sem_init(&dealt_with, 0, 0);
    begin_turn();
}

static void advance(uint64_t ns)
{
    uint64_t until = now + ns;
    while (until > granted) {
        uint64_t more[2] = {0, 0};
        now = granted;
        end_turn();
        if (write(events, "T", 1) != 1 || read(grants, more, sizeof more) != sizeof more)
            _exit(3); /* the simulator has gone */
        for (; more[1] > 0; more[1]--)
            while (sem_wait(&dealt_with) != 0 && errno == EINTR)
                ;
        begin_turn();
        granted += more[0];
    }
    now = until;
}

int clock_gettime(clockid_t id, struct timespec *ts)
{
    if (grants < 0 || id != CLOCK_MONOTONIC)
        return (int)syscall(SYS_clock_gettime, id, ts);
    if (is_main)
        advance(LOOK_NS);
    ts->tv_sec = now / 1000000000;
    ts->tv_nsec = now % 1000000000;
    return 0;
}

int nanosleep(const struct timespec *wanted, struct timespec *left)
{
    if (grants < 0 || !is_main)
        return (int)syscall(SYS_nanosleep, wanted, left);
    advance((uint64_t)wanted->tv_sec * 1000000000 + wanted->tv_nsec);
    return 0;
}

int select(int n, fd_set *in, fd_set *out, fd_set *odd, struct timeval *limit)
{
    static int (*real)(int, fd_set *, fd_set *, fd_set *, struct timeval *);
    if (!real)
        real = dlsym(RTLD_NEXT, "select");
    if (took) {
        took = 0;
        sem_post(&dealt_with);
    }
    end_turn();
    int found = real(n, in, out, odd, limit);
    int why = errno;
    begin_turn();
    errno = why;
    return found;
}

struct job {
    void *(*run)(void *);
    void *data;
};

static void *run_in_turn(void *begun)
{
    struct job own = *(struct job *)begun;
    free(begun);
    begin_turn();
    void *result = own.run(own.data);
    end_turn();
    return result;
}

int pthread_create(pthread_t *thread, const pthread_attr_t *how, void *(*run)(void *), void *data)
{
    static int (*real)(pthread_t *, const pthread_attr_t *, void *(*)(void *), void *);
    if (!real)
        real = dlsym(RTLD_NEXT, "pthread_create");
    struct job *begun = grants < 0 ? NULL : malloc(sizeof *begun);
    if (!begun)
        return real(thread, how, run, data);
    *begun = (struct job){run, data};
    return real(thread, how, run_in_turn, begun);
}

int pthread_join(pthread_t thread, void **result)
{
    static int (*real)(pthread_t, void **);
    if (!real)
        real = dlsym(RTLD_NEXT, "pthread_join");
    end_turn();
    int failed = real(thread, result);
    begin_turn();
    return failed;
}

ssize_t recvfrom(int fd, void *data, size_t size, int flags, struct sockaddr *from, socklen_t *length)
{
    static ssize_t (*real)(int, void *, size_t, int, struct sockaddr *, socklen_t *);
    if (!real)
        real = dlsym(RTLD_NEXT, "recvfrom");
    ssize_t got = real(fd, data, size, flags, from, length);
    if (grants >= 0 && got > 0)
        took = 1;
    return got;
}

static void move(struct sockaddr_storage *to, int here)
{
    if (to->ss_family == AF_INET) {
        struct sockaddr_in *v4 = (struct sockaddr_in *)to;
        v4->sin_port = htons(ntohs(v4->sin_port) + offset);
        if (here)
            v4->sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    } else if (to->ss_family == AF_INET6) {
        struct sockaddr_in6 *v6 = (struct sockaddr_in6 *)to;
        v6->sin6_port = htons(ntohs(v6->sin6_port) + offset);
        if (here)
            v6->sin6_addr = in6addr_loopback;
    }
}

int bind(int fd, const struct sockaddr *to, socklen_t length)
{
    static int (*real)(int, const struct sockaddr *, socklen_t);
    if (!real)
        real = dlsym(RTLD_NEXT, "bind");
    if (grants < 0 || length > sizeof(struct sockaddr_storage))
        return real(fd, to, length);
    struct sockaddr_storage own;
    memcpy(&own, to, length);
    move(&own, 1);
    return real(fd, (struct sockaddr *)&own, length);
}

ssize_t sendto(int fd, const void *data, size_t size, int flags, const struct sockaddr *to, socklen_t length)
{
    static ssize_t (*real)(int, const void *, size_t, int, const struct sockaddr *, socklen_t);
    if (!real)
        real = dlsym(RTLD_NEXT, "sendto");
    if (grants < 0 || !to || length > sizeof(struct sockaddr_storage))
        return real(fd, data, size, flags, to, length);
    struct sockaddr_storage moved;
    memcpy(&moved, to, length);
    move(&moved, 0);
    return real(fd, data, size, flags, (struct sockaddr *)&moved, length);
}
