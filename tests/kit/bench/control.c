/* The control of the SYNC rows: a bare loop that wakes early, spins to its grid, sends one frame, and notes how late it was.
 * It keeps the processors awake, where it may. control DESCRIPTOR PERIOD_US SECONDS; prints JSON. */
#define _GNU_SOURCE
#include <fcntl.h>
#include <math.h>
#include <sched.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

static const int64_t SPIN = 100000, SECOND = 1000000000;

static int64_t now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * SECOND + t.tv_nsec;
}

static int by_size(const void *a, const void *b) {
    int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;
    return (x > y) - (x < y);
}

int main(int argc, char **argv) {
    if (argc != 4) return 2;
    int line = atoi(argv[1]);
    int64_t period = atoll(argv[2]) * 1000, count = (int64_t)(atof(argv[3]) * SECOND / period), done = 0, lost = 0;
    int64_t *late = malloc(sizeof(int64_t) * (size_t)count);
    char frame[16] = {(char)0x80};
    struct sched_param priority = {.sched_priority = 50};
    sched_setscheduler(0, SCHED_FIFO, &priority);
    mlockall(MCL_CURRENT | MCL_FUTURE);
    prctl(PR_SET_TIMERSLACK, 1, 0, 0, 0);
    int32_t at_once = 0;
    int latency = open("/dev/cpu_dma_latency", O_WRONLY); /* held until the end */
    if (latency >= 0 && write(latency, &at_once, sizeof at_once) < 0) return 3;
    for (int64_t due = now() + period, end = due + count * period; due < end; due += period) {
        int64_t early = due - SPIN;
        struct timespec until = {early / SECOND, early % SECOND};
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL);
        while (now() < due) { }
        int64_t behind = now() - due;
        if (behind >= period) {
            lost += behind / period;
            due += behind / period * period;
            behind %= period;
        }
        if (done < count) late[done++] = behind;
        send(line, frame, sizeof frame, MSG_DONTWAIT);
    }
    qsort(late, (size_t)done, sizeof *late, by_size);
    printf("{\"cycles\": %lld, \"lost\": %lld, \"p50\": %.9f, \"p99\": %.9f, \"worst\": %.9f}\n", (long long)done, (long long)lost,
           late[done / 2] * 1e-9, late[(int64_t)floor(done * 0.99)] * 1e-9, late[done - 1] * 1e-9);
    return 0;
}
