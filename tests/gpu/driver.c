// A CUDA driver for machines without a device: the functions of `libcuda.so` that the library calls, and the kernels as C functions.
//
// The tests build this file and the kernels as one shared library and place it where the program looks for the driver:
//
//     gcc -std=gnu11 -O2 -Wall -Wextra -ffp-contract=off -mfma -fPIC -shared -DEMULATED -I src/gpu/kernels
//         -o DIR/libcuda.so tests/gpu/driver.c -x c src/gpu/kernels/kernels.cu
//
// It is stricter than a device where a mistake would stay unseen there. Memory that was never written is NaN. Writing behind an allocation
// aborts the program. An empty allocation and an empty launch are errors, and so is a call from a thread to which no context is bound.
//
// Environment variables, read by cuInit:
//
//     BFREE_GPU_ORDER   forward (default), backward, or scrambled: the order of the blocks of a launch, and of the threads of a phase
//     BFREE_GPU_MEMORY  bytes of memory of the device; 4 GiB by default
//     BFREE_GPU_FAIL    N: launch N, counted from 1, and every later call that needs the device fail
//     BFREE_GPU_LOG     a file, to which the end of the program appends what was launched, copied and allocated

#define _GNU_SOURCE // dladdr
#include <dlfcn.h>
#include <pthread.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "language.h"

// The codes of CUresult that occur here.
#define RESULTS(_)                                                     \
    _(CUDA_SUCCESS, 0, "no error")                                     \
    _(CUDA_ERROR_INVALID_VALUE, 1, "invalid argument")                 \
    _(CUDA_ERROR_OUT_OF_MEMORY, 2, "out of memory")                    \
    _(CUDA_ERROR_NOT_INITIALIZED, 3, "initialization error")           \
    _(CUDA_ERROR_INVALID_DEVICE, 101, "invalid device ordinal")        \
    _(CUDA_ERROR_INVALID_IMAGE, 200, "device kernel image is invalid") \
    _(CUDA_ERROR_INVALID_CONTEXT, 201, "invalid device context")       \
    _(CUDA_ERROR_INVALID_HANDLE, 400, "invalid resource handle")       \
    _(CUDA_ERROR_NOT_FOUND, 500, "named symbol not found")             \
    _(CUDA_ERROR_LAUNCH_FAILED, 719, "unspecified launch failure")
#define CODE(name, code, text) name = code,
#define ROW(name, code, text) {code, #name, text},
typedef enum { RESULTS(CODE) } Result;
static const struct {
    Result code;
    const char *name, *text;
} RESULT[] = {RESULTS(ROW)};

#define DEFAULT_SHARED (48 << 10) // bytes of shared memory of a block, unless the program asks for more
#define LARGEST_SHARED (227 << 10)
#define GUARD 256                 // bytes behind each allocation that nobody may write
#define GUARD_BYTE 0xfe           // unlike 0xff, so that a NaN written there shows

typedef uint64_t Pointer; // a device pointer: here, an address of this process

struct Allocation {
    struct Allocation *next;
    char *start;
    size_t bytes;
};

struct Function {
    struct Function *next;
    char *name;
    void (*run)(void **arguments);
    size_t shared, launches;
};

static enum { FORWARD, BACKWARD, SCRAMBLED } order;
static int initialised, failed, context; // `context` only lends its address
static size_t memory, used, peak, launches, failing_launch, to_device, to_host;
static struct Allocation *allocations;
static struct Function *functions;

_Thread_local unsigned emulated_block;
_Thread_local double emulated_shared[LARGEST_SHARED / sizeof(double)];
static _Thread_local unsigned phase; // phases begun by the launch
static _Thread_local void *current;  // the context of this thread

// All calls exclude each other, launches too: the default stream runs one at a time anyway. The lock ends with the scope.
static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
static int lock(void) { return pthread_mutex_lock(&mutex); }
static void unlock(int *locked) { (void)locked, pthread_mutex_unlock(&mutex); }
#define LOCKED __attribute__((cleanup(unlock), unused)) int locked = lock()

// The beginning of a call that needs the device.
#define DEVICE_CALL                                 \
    LOCKED;                                         \
    if (!current) return CUDA_ERROR_INVALID_CONTEXT; \
    if (failed) return CUDA_ERROR_LAUNCH_FAILED

// The order

// Element i of a permutation of 0..n, another one for each seed. Each step maps the numbers of as many bits as n needs one to one onto
// themselves. They repeat until the number is below n again, which keeps the map one to one.
static unsigned scrambled(unsigned i, unsigned n, unsigned seed) {
    if (n < 2) return i;
    unsigned bits = 32 - __builtin_clz(n - 1), mask = ~0u >> (32 - bits);
    do {
        i = (i * (2 * seed + 0x9e3779b1) + seed * 0x85ebca6b) & mask;
        i ^= i >> (bits + 1) / 2;
        i = i * 0xc2b2ae35 & mask;
    } while (i >= n);
    return i;
}

static unsigned ordered(unsigned i, unsigned n, unsigned seed) {
    return order == FORWARD ? i : order == BACKWARD ? n - 1 - i : scrambled(i, n, seed);
}

// The thread that runs at a step of a phase. A phase ends by asking for step THREADS, which has none.
int emulated_thread(int step) {
    if (step == 0) phase++;
    return step < THREADS ? (int)ordered(step, THREADS, phase + 977 * emulated_block) : THREADS;
}

// Errors

static Result describe(Result code, int text, const char **out) {
    *out = NULL;
    for (size_t i = 0; i < sizeof RESULT / sizeof *RESULT; i++)
        if (RESULT[i].code == code) *out = text ? RESULT[i].text : RESULT[i].name;
    return *out ? CUDA_SUCCESS : CUDA_ERROR_INVALID_VALUE;
}
Result cuGetErrorName(Result code, const char **out) { return describe(code, 0, out); }
Result cuGetErrorString(Result code, const char **out) { return describe(code, 1, out); }

// Beginning and end

static size_t number(const char *name, size_t otherwise) {
    const char *text = getenv(name);
    return text && *text ? strtoull(text, NULL, 10) : otherwise;
}

Result cuInit(unsigned flags) {
    LOCKED;
    if (flags) return CUDA_ERROR_INVALID_VALUE;
    const char *text = getenv("BFREE_GPU_ORDER");
    if (!text || !*text || !strcmp(text, "forward")) order = FORWARD;
    else if (!strcmp(text, "backward")) order = BACKWARD;
    else if (!strcmp(text, "scrambled")) order = SCRAMBLED;
    else return CUDA_ERROR_INVALID_VALUE;
    memory = number("BFREE_GPU_MEMORY", (size_t)4 << 30);
    failing_launch = number("BFREE_GPU_FAIL", 0);
    initialised = 1;
    return CUDA_SUCCESS;
}

static void check_guard(const struct Allocation *a) {
    for (size_t i = 0; i < GUARD; i++)
        if ((unsigned char)a->start[a->bytes + i] != GUARD_BYTE) {
            fprintf(stderr, "emulated driver: a kernel wrote byte %zu behind an allocation of %zu bytes\n", i, a->bytes);
            abort();
        }
}

// Runs when the program ends. A program that only looks whether there is a driver unloads it without cuInit.
__attribute__((destructor)) static void end(void) {
    for (struct Allocation *a = allocations; a; a = a->next) check_guard(a);
    const char *path = getenv("BFREE_GPU_LOG");
    FILE *log = initialised && path && *path ? fopen(path, "a") : NULL;
    if (!log) return;
    fprintf(log, "launches %zu to_device %zu to_host %zu peak %zu left %zu\n", launches, to_device, to_host, peak, used);
    // A kernel is a function of each module that was loaded. The first one with its name prints the sum.
    for (struct Function *f = functions; f; f = f->next) {
        size_t sum = 0;
        struct Function *first = NULL;
        for (struct Function *g = functions; g; g = g->next)
            if (!strcmp(f->name, g->name)) {
                if (!first) first = g;
                sum += g->launches;
            }
        if (first == f) fprintf(log, "%s %zu\n", f->name, sum);
    }
    fclose(log);
}

// Device and context

static Result device_found(int device) {
    return !initialised ? CUDA_ERROR_NOT_INITIALIZED : device == 0 ? CUDA_SUCCESS : CUDA_ERROR_INVALID_DEVICE;
}
Result cuDeviceGetCount(int *count) { return *count = 1, device_found(0); }
Result cuDeviceGet(int *device, int ordinal) { return *device = ordinal, device_found(ordinal); }
Result cuDeviceGetName(char *name, int bytes, int device) { return snprintf(name, bytes, "emulated device"), device_found(device); }
Result cuDeviceTotalMem_v2(size_t *bytes, int device) { return *bytes = memory, device_found(device); }
Result cuDeviceGetAttribute(int *value, int attribute, int device) {
    switch (attribute) {
    case 1: *value = 1024; break;            // MAX_THREADS_PER_BLOCK
    case 8: *value = DEFAULT_SHARED; break;  // MAX_SHARED_MEMORY_PER_BLOCK
    case 10: *value = 32; break;             // WARP_SIZE
    case 16: *value = 4; break;              // MULTIPROCESSOR_COUNT
    case 75: *value = 9; break;              // COMPUTE_CAPABILITY_MAJOR
    case 76: *value = 0; break;              // COMPUTE_CAPABILITY_MINOR
    case 97: *value = LARGEST_SHARED; break; // MAX_SHARED_MEMORY_PER_BLOCK_OPTIN
    case 115: *value = 1; break;             // MEMORY_POOLS_SUPPORTED: cudarc then allocates by cuMemAllocAsync
    default: return CUDA_ERROR_INVALID_VALUE;
    }
    return device_found(device);
}
Result cuDriverGetVersion(int *version) { return *version = (int)number("BFREE_GPU_DRIVER", 12000), CUDA_SUCCESS; }
Result cuDevicePrimaryCtxRetain(void **out, int device) {
    *out = &context;
    return failed ? CUDA_ERROR_LAUNCH_FAILED : device_found(device);
}
Result cuDevicePrimaryCtxRelease_v2(int device) { return device_found(device); }
Result cuCtxGetCurrent(void **out) { return *out = current, CUDA_SUCCESS; }
Result cuCtxSetCurrent(void *bound) {
    if (bound && bound != &context) return CUDA_ERROR_INVALID_CONTEXT;
    current = bound;
    return CUDA_SUCCESS;
}

// Waiting. A launch has ended when cuLaunchKernel returns, so there is nothing to wait for, and an event is but a handle.
// The only stream is the default stream, NULL.

static Result valid(int handle) {
    DEVICE_CALL;
    return handle ? CUDA_SUCCESS : CUDA_ERROR_INVALID_HANDLE;
}
Result cuCtxSynchronize(void) { return valid(1); }
Result cuStreamSynchronize(void *stream) { return valid(!stream); }
Result cuStreamWaitEvent(void *stream, void *event, unsigned flags) { return valid(!stream && event && !flags); }
Result cuEventCreate(void **out, unsigned flags) { return (void)flags, *out = malloc(1), valid(1); }
Result cuEventRecord(void *event, void *stream) { return valid(!stream && event); }
Result cuEventSynchronize(void *event) { return valid(event != NULL); }
Result cuEventDestroy_v2(void *event) { return free(event), valid(event != NULL); }

// Memory

Result cuMemGetInfo_v2(size_t *free_bytes, size_t *total) {
    DEVICE_CALL;
    *free_bytes = memory - used, *total = memory;
    return CUDA_SUCCESS;
}
Result cuMemAlloc_v2(Pointer *out, size_t bytes) {
    DEVICE_CALL;
    if (bytes == 0) return CUDA_ERROR_INVALID_VALUE;
    if (bytes > memory - used) return CUDA_ERROR_OUT_OF_MEMORY;
    struct Allocation *a = malloc(sizeof *a);
    // A device aligns to 256 bytes, and so does this.
    char *start = aligned_alloc(256, (bytes + GUARD + 255) / 256 * 256);
    if (!a || !start) return free(a), free(start), CUDA_ERROR_OUT_OF_MEMORY;
    memset(start, 0xff, bytes);
    memset(start + bytes, GUARD_BYTE, GUARD);
    *a = (struct Allocation){allocations, start, bytes};
    allocations = a;
    used += bytes;
    if (used > peak) peak = used;
    *out = (Pointer)start;
    return CUDA_SUCCESS;
}
Result cuMemFree_v2(Pointer pointer) {
    DEVICE_CALL;
    for (struct Allocation **link = &allocations; *link; link = &(*link)->next) {
        struct Allocation *a = *link;
        if ((Pointer)a->start != pointer) continue;
        check_guard(a);
        *link = a->next;
        used -= a->bytes;
        free(a->start), free(a);
        return CUDA_SUCCESS;
    }
    return CUDA_ERROR_INVALID_VALUE;
}
Result cuMemAllocAsync(Pointer *out, size_t bytes, void *stream) {
    return stream ? CUDA_ERROR_INVALID_HANDLE : cuMemAlloc_v2(out, bytes);
}
// The memory pool keeps nothing here.
Result cuDeviceGetDefaultMemPool(void **pool, int device) { return *pool = &memory, device_found(device); }
Result cuMemPoolSetAttribute(void *pool, int attribute, void *value) {
    return pool == &memory && attribute == 4 && value ? CUDA_SUCCESS : CUDA_ERROR_INVALID_VALUE; // RELEASE_THRESHOLD
}
Result cuMemFreeAsync(Pointer pointer, void *stream) { return stream ? CUDA_ERROR_INVALID_HANDLE : cuMemFree_v2(pointer); }

// Whether all of these bytes lie in one allocation.
static int allocated(Pointer pointer, size_t bytes) {
    for (struct Allocation *a = allocations; a; a = a->next) {
        Pointer start = (Pointer)a->start;
        if (pointer >= start && pointer - start <= a->bytes && bytes <= a->bytes - (pointer - start)) return 1;
    }
    return bytes == 0;
}
Result cuMemsetD8Async(Pointer to, unsigned char value, size_t bytes, void *stream) {
    DEVICE_CALL;
    if (stream || !allocated(to, bytes)) return CUDA_ERROR_INVALID_VALUE;
    return memset((void *)to, value, bytes), CUDA_SUCCESS;
}
Result cuMemcpyHtoDAsync_v2(Pointer to, const void *from, size_t bytes, void *stream) {
    DEVICE_CALL;
    if (stream || !allocated(to, bytes)) return CUDA_ERROR_INVALID_VALUE;
    to_device += bytes;
    return memcpy((void *)to, from, bytes), CUDA_SUCCESS;
}
Result cuMemcpyDtoHAsync_v2(void *to, Pointer from, size_t bytes, void *stream) {
    DEVICE_CALL;
    if (stream || !allocated(from, bytes)) return CUDA_ERROR_INVALID_VALUE;
    to_host += bytes;
    return memcpy(to, (const void *)from, bytes), CUDA_SUCCESS;
}
Result cuMemcpyDtoDAsync_v2(Pointer to, Pointer from, size_t bytes, void *stream) {
    DEVICE_CALL;
    if (stream || !allocated(from, bytes) || !allocated(to, bytes)) return CUDA_ERROR_INVALID_VALUE;
    return memmove((void *)to, (const void *)from, bytes), CUDA_SUCCESS;
}

// Modules and kernels

// A module is a copy of its PTX, which is never run. It is kept to know which kernels it has.
Result cuModuleLoadData(char **out, const char *image) {
    DEVICE_CALL;
    if (!strstr(image, ".version")) return CUDA_ERROR_INVALID_IMAGE;
    return *out = strdup(image), CUDA_SUCCESS;
}
Result cuModuleUnload(char *module) { return free(module), valid(1); }
// A kernel must be in the PTX as well as in C: then a PTX older than its source shows.
Result cuModuleGetFunction(struct Function **out, const char *module, const char *name) {
    DEVICE_CALL;
    char entry[256];
    snprintf(entry, sizeof entry, ".entry %s(", name);
    if (!strstr(module, entry)) return CUDA_ERROR_NOT_FOUND;
    // The program loads this library for itself alone, and the kernels can only be looked up in it by its path.
    Dl_info self;
    void *library = dladdr(&functions, &self) ? dlopen(self.dli_fname, RTLD_LAZY | RTLD_NOLOAD) : NULL;
    if (!library) return CUDA_ERROR_NOT_FOUND;
    void *run = dlsym(library, name);
    dlclose(library);
    if (!run) return CUDA_ERROR_NOT_FOUND;
    // It outlives its module, for the log.
    struct Function *f = malloc(sizeof *f), **last = &functions;
    *f = (struct Function){NULL, strdup(name), (void (*)(void **))run, DEFAULT_SHARED, 0};
    while (*last) last = &(*last)->next;
    *last = *out = f;
    return CUDA_SUCCESS;
}
Result cuFuncSetAttribute(struct Function *f, int attribute, int value) {
    DEVICE_CALL;
    if (attribute != 8 || value < 0 || value > LARGEST_SHARED) return CUDA_ERROR_INVALID_VALUE; // MAX_DYNAMIC_SHARED_SIZE_BYTES
    f->shared = value;
    return CUDA_SUCCESS;
}
Result cuLaunchKernel(struct Function *f, unsigned blocks, unsigned blocks_y, unsigned blocks_z, unsigned threads, unsigned threads_y,
                      unsigned threads_z, unsigned shared, void *stream, void **arguments, void **extra) {
    DEVICE_CALL;
    if (stream) return CUDA_ERROR_INVALID_HANDLE;
    if (blocks == 0 || blocks > INT32_MAX || blocks_y != 1 || blocks_z != 1) return CUDA_ERROR_INVALID_VALUE;
    if (threads != THREADS || threads_y != 1 || threads_z != 1) return CUDA_ERROR_INVALID_VALUE;
    if (shared > f->shared || !arguments || extra) return CUDA_ERROR_INVALID_VALUE;
    launches++, f->launches++;
    if (launches == failing_launch) {
        failed = 1;
        return CUDA_ERROR_LAUNCH_FAILED;
    }
    phase = 0;
    for (unsigned i = 0; i < blocks; i++) {
        emulated_block = ordered(i, blocks, (unsigned)launches);
        memset(emulated_shared, 0xff, shared);
        f->run(arguments);
    }
    return CUDA_SUCCESS;
}
