/* Counts the allocations of one shared library. To be loaded with LD_PRELOAD, before all other libraries. glibc only. */
#include <stddef.h>
#include <stdint.h>

extern void *__libc_malloc(size_t);
extern void *__libc_calloc(size_t, size_t);
extern void *__libc_realloc(void *, size_t);
extern void *__libc_memalign(size_t, size_t);

static uintptr_t first, end;            /* addresses of the library's code */
static int (*holds_lock)(void);         /* whether the thread holds the interpreter's lock */
static unsigned long counts[2];         /* without and with the lock */

void counting_watch(uintptr_t from, uintptr_t to, int (*holds)(void)) {
    holds_lock = holds;
    end = to;
    first = from;
}

unsigned long counting_count(int with_lock) { return counts[with_lock]; }

static void count(void *caller) {
    uintptr_t at = (uintptr_t)caller;
    if (first && at >= first && at < end) counts[holds_lock() ? 1 : 0]++;
}

void *malloc(size_t size) {
    count(__builtin_return_address(0));
    return __libc_malloc(size);
}

void *calloc(size_t count_, size_t size) {
    count(__builtin_return_address(0));
    return __libc_calloc(count_, size);
}

void *realloc(void *old, size_t size) {
    count(__builtin_return_address(0));
    return __libc_realloc(old, size);
}

void *memalign(size_t alignment, size_t size) {
    count(__builtin_return_address(0));
    return __libc_memalign(alignment, size);
}

void *aligned_alloc(size_t alignment, size_t size) {
    count(__builtin_return_address(0));
    return __libc_memalign(alignment, size);
}

int posix_memalign(void **to, size_t alignment, size_t size) {
    count(__builtin_return_address(0));
    *to = __libc_memalign(alignment, size);
    return *to ? 0 : 12; /* ENOMEM */
}
