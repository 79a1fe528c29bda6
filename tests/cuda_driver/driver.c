/* Simulated CUDA driver without a GPU, for tests. The CPU simulates its devices. Device memory is a separate part of host
 * memory.
 *
 *     cc -shared -fPIC -o libcuda.so.1 driver.c -ldl -lpthread
 *
 * It provides the functions that Condyle calls, with the real driver's rules, and detects mistakes in their use:
 * - An operation on a stream runs only when the host waits for it or for a later operation. So a missing order of two
 *   operations is detected. The legacy default stream is ordered with all streams that are not "non-blocking".
 * - Only kernels and copies can access device memory: any other access is a segmentation fault. Device memory begins as NaN, a
 *   guard follows it, and freed memory is never reused.
 * - Handles, pointers, sizes, and the context that must be current are checked. `fake_complaint` reports mistakes that a driver
 *   would silently allow. `fake_live` counts the objects that were created and not destroyed, `fake_fail` makes a function fail.
 *
 * nvrtc.c compiles a kernel to a shared library with a function that runs one thread. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

typedef int CUresult;
typedef uintptr_t CUdeviceptr;
typedef struct Context { int ordinal, retained; } Context;
typedef struct Stream { Context *context; int alive, nonblocking, legacy; } Stream;
typedef struct Event { Context *context; int alive; long op; } Event;
typedef struct Module { Context *context; int alive; void *library; } Module;
typedef void Thread(void **parameters, const unsigned *grid, const unsigned *block, unsigned thread, unsigned threads);
typedef struct Function { Module *module; Thread *thread; int parameters; } Function;
typedef struct Block { char *base; size_t size, mapped; Context *context; int alive; } Block;
enum { LAUNCH, UPLOAD, DOWNLOAD, RECORD, WAIT };
enum { PARAMETERS = 64, DEVICES = 2, PAGE = 4096, LARGEST = 640 };
typedef struct Op {
    int kind, done;
    Stream *stream;
    long after; /* WAIT: index of the operation */
    Thread *thread;
    int parameters;
    void *values[PARAMETERS];
    unsigned grid[2], block;
    char *to, *from;
    size_t size;
} Op;

enum { OK = 0, INVALID_VALUE = 1, OUT_OF_MEMORY = 2, NOT_INITIALIZED = 3, NO_DEVICE = 100, INVALID_DEVICE = 101, INVALID_CONTEXT = 201,
       NO_BINARY_FOR_GPU = 209, INVALID_PTX = 218, INVALID_HANDLE = 400, NOT_FOUND = 500, NOT_READY = 600 };

static pthread_mutex_t lock = PTHREAD_RECURSIVE_MUTEX_INITIALIZER_NP;
static int initialised, devices = DEVICES;
static Context contexts[DEVICES];
static Stream legacy[DEVICES], per_thread[DEVICES];
static __thread Context *current[16];
static __thread int depth;
static Block *blocks;
static size_t block_count;
static Op **ops;
static long op_count;
static long live[5]; /* memory, streams, events, modules, contexts */
static char complaint[400], failing[64];
static int failing_with;
static unsigned last_launch[3];
static long launches;

static void complain(const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    if (!complaint[0]) vsnprintf(complaint, sizeof complaint, format, arguments);
    va_end(arguments);
}

/* Returns the error with which a function must fail, or OK. Every function of the driver calls this first. */
static CUresult enter(const char *name, int needs_context) {
    if (failing_with && !strcmp(failing, name)) {
        int code = failing_with;
        failing_with = 0;
        return code;
    }
    if (!initialised) return NOT_INITIALIZED;
    return needs_context && depth == 0 ? INVALID_CONTEXT : OK;
}
#define API(name, needs_context, ...) \
    pthread_mutex_lock(&lock); \
    CUresult status = enter(name, needs_context); \
    if (status == OK) do { __VA_ARGS__ } while (0); \
    pthread_mutex_unlock(&lock); \
    return status
#define REFUSE(code) { status = code; break; }
#define CONTEXT current[depth - 1]

long fake_live(int kind) { return live[kind]; }
const char *fake_complaint(void) { return complaint; }
void fake_fail(const char *name, int code) { snprintf(failing, sizeof failing, "%s", name); failing_with = code; }
void fake_devices(int count) { devices = count; }
/* Returns the number of launches; `last` receives blocks, threads of a block, and rows of blocks of the last launch. */
long fake_launches(unsigned *last) { memcpy(last, last_launch, sizeof last_launch); return launches; }
long fake_pending(void) { long n = 0; for (long k = 0; k < op_count; k++) n += !ops[k]->done; return n; }

static Block *block_of(const char *p, size_t size, Context *context) {
    for (size_t k = 0; k < block_count; k++) {
        Block *b = &blocks[k];
        if (b->alive && b->context == context && p >= b->base && p + size <= b->base + b->size) return b;
    }
    return NULL;
}

static void open_memory(int open) {
    for (size_t k = 0; k < block_count; k++)
        if (blocks[k].alive) mprotect(blocks[k].base, blocks[k].mapped - PAGE, open ? PROT_READ | PROT_WRITE : PROT_NONE);
}

/* Checks that the memory between a block's end and its guard page is unchanged. */
static void check_ends(void) {
    for (size_t k = 0; k < block_count; k++) {
        Block *b = &blocks[k];
        for (char *p = b->base + b->size; b->alive && p < b->base + b->mapped - PAGE; p++)
            if (*p != (char)0xA5) { complain("something was written behind %zu bytes of memory", b->size); break; }
    }
}

static Stream *stream_of(void *handle) {
    if ((uintptr_t)handle <= 1) return &legacy[CONTEXT->ordinal];
    if ((uintptr_t)handle == 2) return &per_thread[CONTEXT->ordinal];
    Stream *stream = handle;
    return stream->alive ? stream : NULL;
}

/* Returns whether the second operation must wait for the first one because of their streams. */
static int ordered(const Op *a, const Op *b) {
    const Stream *s = a->stream, *t = b->stream;
    return s == t || (s->context == t->context && ((s->legacy && !t->nonblocking) || (t->legacy && !s->nonblocking)));
}

static void execute(Op *op) {
    open_memory(1);
    if (op->kind == LAUNCH)
        for (unsigned y = 0; y < op->grid[1]; y++)
            for (unsigned x = 0; x < op->grid[0]; x++)
                for (unsigned t = 0; t < op->block; t++) op->thread(op->values, op->grid, (unsigned[]){x, y}, t, op->block);
    if (op->kind == UPLOAD || op->kind == DOWNLOAD) memcpy(op->to, op->from, op->size);
    check_ends();
    open_memory(0);
}

/* Runs an operation after the operations that it waits for. */
static void run(long k) {
    Op *op = ops[k];
    if (op->done) return;
    op->done = 1; /* no earlier operation waits for it */
    for (long j = 0; j < k; j++)
        if (!ops[j]->done && ordered(ops[j], op)) run(j);
    if (op->kind == WAIT && op->after >= 0) run(op->after);
    execute(op);
    if (op->kind == LAUNCH)
        for (int p = 0; p < op->parameters; p++) free(op->values[p]);
}

static void drain(Stream *stream, Context *context) {
    for (long k = 0; k < op_count; k++)
        if (stream ? ops[k]->stream == stream : ops[k]->stream->context == context) run(k);
}

static Op *push(int kind, Stream *stream) {
    ops = realloc(ops, (op_count + 1) * sizeof *ops);
    Op *op = ops[op_count++] = calloc(1, sizeof *op);
    op->kind = kind;
    op->stream = stream;
    op->after = -1;
    return op;
}

CUresult cuInit(unsigned flags) {
    pthread_mutex_lock(&lock);
    for (int d = 0; !initialised && d < DEVICES; d++) {
        contexts[d].ordinal = d;
        legacy[d] = (Stream){&contexts[d], 1, 0, 1};
        per_thread[d] = (Stream){&contexts[d], 1, 0, 0};
    }
    initialised = flags == 0;
    CUresult status = enter("cuInit", 0);
    pthread_mutex_unlock(&lock);
    return status != OK ? status : devices == 0 ? NO_DEVICE : OK;
}

CUresult cuDeviceGetCount(int *count) { API("cuDeviceGetCount", 0, *count = devices;); }
CUresult cuDeviceGet(int *device, int ordinal) {
    API("cuDeviceGet", 0, if (ordinal < 0 || ordinal >= devices) REFUSE(INVALID_DEVICE) *device = ordinal;);
}
CUresult cuDeviceGetName(char *name, int length, int device) {
    API("cuDeviceGetName", 0, snprintf(name, length, "No GPU %d", device););
}
CUresult cuDeviceGetAttribute(int *value, int attribute, int device) {
    API("cuDeviceGetAttribute", 0, switch (attribute) {
        case 16: *value = 4; break;      /* multiprocessors */
        case 75: *value = 9; break;      /* compute capability: 9.0, and 9.9, which no compiler supports */
        case 76: *value = 9 * device; break;
        default: status = INVALID_VALUE; });
}
CUresult cuDevicePrimaryCtxRetain(Context **context, int device) {
    API("cuDevicePrimaryCtxRetain", 0, contexts[device].retained++; live[4]++; *context = &contexts[device];);
}
CUresult cuDevicePrimaryCtxRelease_v2(int device) {
    API("cuDevicePrimaryCtxRelease_v2", 0,
        if (!contexts[device].retained) { complain("the context was released too often"); REFUSE(INVALID_CONTEXT) }
        contexts[device].retained--; live[4]--;);
}
CUresult cuCtxPushCurrent_v2(Context *context) {
    API("cuCtxPushCurrent_v2", 0,
        if (!context->retained) { complain("a context that was released is made the current one"); REFUSE(INVALID_CONTEXT) }
        current[depth++] = context;);
}
CUresult cuCtxPopCurrent_v2(Context **context) { API("cuCtxPopCurrent_v2", 1, depth--; if (context) *context = current[depth];); }
CUresult cuCtxSynchronize(void) { API("cuCtxSynchronize", 1, drain(NULL, CONTEXT);); }

CUresult cuMemAlloc_v2(CUdeviceptr *pointer, size_t size) {
    API("cuMemAlloc_v2", 1,
        if (size == 0) REFUSE(INVALID_VALUE)
        size_t mapped = (size + PAGE - 1) / PAGE * PAGE + PAGE;
        char *base = mmap(NULL, mapped, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
        if (base == MAP_FAILED) REFUSE(OUT_OF_MEMORY)
        memset(base, 0xFF, size);
        memset(base + size, 0xA5, mapped - PAGE - size);
        mprotect(base, mapped, PROT_NONE);
        blocks = realloc(blocks, (block_count + 1) * sizeof *blocks);
        blocks[block_count++] = (Block){base, size, mapped, CONTEXT, 1};
        live[0]++;
        *pointer = (CUdeviceptr)base;);
}
CUresult cuMemFree_v2(CUdeviceptr pointer) {
    API("cuMemFree_v2", 1,
        Block *b = block_of((char *)pointer, 0, CONTEXT);
        if (!b || b->base != (char *)pointer) { complain("memory is freed that is not there"); REFUSE(INVALID_VALUE) }
        drain(NULL, CONTEXT);
        b->alive = 0; /* the addresses are never reused */
        live[0]--;);
}
CUresult cuPointerGetAttribute(void *value, int attribute, CUdeviceptr pointer) {
    API("cuPointerGetAttribute", 1,
        int found = -1;
        for (int d = 0; d < DEVICES; d++) if (block_of((char *)pointer, 1, &contexts[d])) found = d;
        if (attribute != 9 || found < 0) REFUSE(INVALID_VALUE)
        *(int *)value = found;);
}
static CUresult copy(const char *name, int kind, char *to, const char *from, size_t size, void *handle) {
    API(name, 1,
        Stream *stream = stream_of(handle);
        if (!stream || stream->context != CONTEXT) REFUSE(INVALID_HANDLE)
        if (!block_of(kind == UPLOAD ? to : from, size, CONTEXT)) {
            complain("%s: %zu bytes are not in one piece of memory", name, size);
            REFUSE(INVALID_VALUE)
        }
        Op *op = push(kind, stream);
        op->to = to; op->from = (char *)from; op->size = size;);
}
CUresult cuMemcpyHtoDAsync_v2(CUdeviceptr to, const void *from, size_t size, void *stream) {
    return copy("cuMemcpyHtoDAsync_v2", UPLOAD, (char *)to, from, size, stream);
}
CUresult cuMemcpyDtoHAsync_v2(void *to, CUdeviceptr from, size_t size, void *stream) {
    return copy("cuMemcpyDtoHAsync_v2", DOWNLOAD, to, (char *)from, size, stream);
}

CUresult cuStreamCreate(Stream **stream, unsigned flags) {
    API("cuStreamCreate", 1, *stream = malloc(sizeof **stream); **stream = (Stream){CONTEXT, 1, flags & 1, 0}; live[1]++;);
}
CUresult cuStreamDestroy_v2(Stream *stream) {
    API("cuStreamDestroy_v2", 1,
        if (!stream_of(stream) || (uintptr_t)stream <= 2) { complain("a stream is destroyed that is not there"); REFUSE(INVALID_HANDLE) }
        stream->alive = 0; live[1]--;); /* its work continues; the handle is never reused */
}
CUresult cuStreamSynchronize(void *handle) {
    pthread_mutex_lock(&lock);
    if (failing_with && !strcmp(failing, "cuStreamSynchronize")) drain(stream_of(handle), NULL); /* all copies are completed */
    pthread_mutex_unlock(&lock);
    API("cuStreamSynchronize", 1, Stream *s = stream_of(handle); if (!s) REFUSE(INVALID_HANDLE) drain(s, NULL););
}
CUresult cuEventCreate(Event **event, unsigned flags) {
    (void)flags;
    API("cuEventCreate", 1, *event = malloc(sizeof **event); **event = (Event){CONTEXT, 1, -1}; live[2]++;);
}
CUresult cuEventDestroy_v2(Event *event) {
    API("cuEventDestroy_v2", 1,
        if (!event->alive) { complain("an event is destroyed twice"); REFUSE(INVALID_HANDLE) }
        event->alive = 0; live[2]--;);
}
CUresult cuEventRecord(Event *event, void *handle) {
    API("cuEventRecord", 1,
        Stream *stream = stream_of(handle);
        if (!event->alive || !stream || stream->context != event->context) REFUSE(INVALID_HANDLE)
        push(RECORD, stream);
        event->op = op_count - 1;);
}
CUresult cuEventQuery(Event *event) {
    API("cuEventQuery", 1, if (!event->alive) REFUSE(INVALID_HANDLE) if (event->op >= 0 && !ops[event->op]->done) status = NOT_READY;);
}
CUresult cuStreamWaitEvent(void *handle, Event *event, unsigned flags) {
    (void)flags;
    API("cuStreamWaitEvent", 1,
        Stream *stream = stream_of(handle);
        if (!event->alive || !stream) REFUSE(INVALID_HANDLE)
        push(WAIT, stream)->after = event->op;);
}

CUresult cuModuleLoadDataEx(Module **module, const void *image, unsigned count, const int *options, void **values) {
    API("cuModuleLoadDataEx", 1,
        char kind[8] = "";
        int architecture = 0;
        char path[256] = "";
        int capability = CONTEXT->ordinal ? 99 : 90;
        if (sscanf(image, "// FAKE %7s %d %255s", kind, &architecture, path) != 3) {
            for (unsigned k = 0; k < count; k++)
                if (options[k] == 5) strcpy(values[k], "ptxas: this is no code");
            REFUSE(INVALID_PTX)
        }
        if (strcmp(kind, "PTX") ? architecture != capability : architecture > capability) REFUSE(NO_BINARY_FOR_GPU)
        void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
        if (!library) { complain("%s", dlerror()); REFUSE(INVALID_PTX) }
        *module = malloc(sizeof **module);
        **module = (Module){CONTEXT, 1, library};
        live[3]++;);
}
CUresult cuModuleUnload(Module *module) {
    API("cuModuleUnload", 1,
        if (!module->alive) { complain("a module is unloaded twice"); REFUSE(INVALID_HANDLE) }
        drain(NULL, module->context);
        module->alive = 0; dlclose(module->library); live[3]--;);
}
CUresult cuModuleGetFunction(Function **function, Module *module, const char *name) {
    API("cuModuleGetFunction", 1,
        char full[200];
        snprintf(full, sizeof full, "fake_thread_%s", name);
        Thread *thread = (Thread *)dlsym(module->library, full);
        snprintf(full, sizeof full, "fake_parameters_%s", name);
        int *parameters = dlsym(module->library, full);
        if (!thread || !parameters) REFUSE(NOT_FOUND)
        *function = malloc(sizeof **function); /* it lives as long as its module */
        **function = (Function){module, thread, *parameters};);
}
CUresult cuFuncGetAttribute(int *value, int attribute, Function *function) {
    (void)function;
    API("cuFuncGetAttribute", 1, switch (attribute) {
        case 0: *value = LARGEST; break;  /* threads of a block */
        case 3: *value = 64; break;       /* bytes of local memory */
        case 4: *value = 96; break;       /* registers */
        default: status = INVALID_VALUE; });
}
CUresult cuOccupancyMaxPotentialBlockSize(int *grid, int *block, Function *f, void *shared_size, size_t shared, int limit) {
    (void)f, (void)shared_size, (void)shared;
    API("cuOccupancyMaxPotentialBlockSize", 1, *grid = 8; *block = limit && limit < 256 ? limit : 256;);
}
CUresult cuLaunchKernel(Function *f, unsigned gx, unsigned gy, unsigned gz, unsigned bx, unsigned by, unsigned bz, unsigned shared,
                        void *handle, void **parameters, void **extra) {
    API("cuLaunchKernel", 1,
        Stream *stream = stream_of(handle);
        if (!stream || !f->module->alive || f->module->context != CONTEXT || stream->context != CONTEXT) REFUSE(INVALID_HANDLE)
        if (gx == 0 || gy == 0 || gy > 65535 || bx == 0 || bx > LARGEST || gz * by * bz != 1 || shared || extra) REFUSE(INVALID_VALUE)
        for (int p = 1; p < f->parameters; p++)
            if (!block_of(*(char **)parameters[p], 1, CONTEXT)) {
                complain("parameter %d of a kernel is no memory of the device", p);
                status = INVALID_VALUE;
            }
        if (status != OK) break;
        Op *op = push(LAUNCH, stream);
        op->thread = f->thread; op->parameters = f->parameters; op->grid[0] = gx; op->grid[1] = gy; op->block = bx;
        for (int p = 0; p < f->parameters; p++) {
            op->values[p] = calloc(1, sizeof(void *));
            memcpy(op->values[p], parameters[p], p == 0 ? sizeof(int) : sizeof(void *));
        }
        last_launch[0] = gx; last_launch[1] = bx; last_launch[2] = gy; launches++;);
}

#define ERRORS(E) \
    E(INVALID_VALUE, "invalid argument") E(OUT_OF_MEMORY, "out of memory") E(NOT_INITIALIZED, "initialization error") \
    E(NO_DEVICE, "no CUDA-capable device is detected") E(INVALID_DEVICE, "invalid device ordinal") \
    E(INVALID_CONTEXT, "invalid device context") E(NO_BINARY_FOR_GPU, "no kernel image is available for execution on the device") \
    E(INVALID_PTX, "a PTX JIT compilation failed") E(INVALID_HANDLE, "invalid resource handle") \
    E(NOT_FOUND, "named symbol not found") E(NOT_READY, "device not ready")
CUresult cuGetErrorName(int code, const char **text) {
#define NAME(name, about) if (code == name) { *text = "CUDA_ERROR_" #name; return OK; }
    ERRORS(NAME)
    *text = code == 700 ? "CUDA_ERROR_ILLEGAL_ADDRESS" : NULL;
    return *text ? OK : INVALID_VALUE;
}
CUresult cuGetErrorString(int code, const char **text) {
#define ABOUT(name, about) if (code == name) { *text = about; return OK; }
    ERRORS(ABOUT)
    *text = code == 700 ? "an illegal memory access was encountered" : NULL;
    return *text ? OK : INVALID_VALUE;
}
