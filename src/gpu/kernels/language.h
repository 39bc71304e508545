// The language of the kernels: CUDA C for a device, and plain C for the tests, which need gcc alone.
//
// A kernel is a sequence of phases. All threads of a thread block end a phase before any of them begins the next one:
//
//     KERNEL(name, Arguments) {          // one argument, the struct `a`, passed by value
//         SHARED(double, sums);          // the shared memory of the thread block
//         PHASE(t) { sums[t] = ...; }
//         PHASE(t) { if (t == 0) ...; }
//     }
//
// On a device, PHASE is the code of one thread, followed by a barrier. In the tests, it is a loop over the threads of a block, in any order
// that the test wants. A variable of a thread does not outlive its phase.
//
// No operation is contracted: fma(a, b, c) is rounded once, and a * b + c twice, as in the library (`lanes.rs`).

// Threads of a thread block, in every kernel.
#define THREADS 128

#ifdef EMULATED
#include <float.h>
#include <math.h>
extern _Thread_local unsigned emulated_block;
extern _Thread_local double emulated_shared[];
int emulated_thread(int step);
#define FUNCTION static inline
#define UNROLL
#define BLOCK emulated_block
#define SHARED(type, name) type *name = (type *)emulated_shared
#define PHASE(t) for (int step_##t = 0, t = emulated_thread(0); step_##t < THREADS; t = emulated_thread(++step_##t))
#define KERNEL(name, type) KERNEL_(name, type)
#define KERNEL_(name, type)                                                              \
    static void name##_of_block(const struct type a);                                   \
    void name(void **arguments) { name##_of_block(*(const struct type *)arguments[0]); } \
    static void name##_of_block(const struct type a)
#else
#define DBL_MAX 1.7976931348623157e308
#define FUNCTION static __device__ __forceinline__
#define UNROLL _Pragma("unroll 16")
#define BLOCK blockIdx.x
#define SHARED(type, name)                            \
    extern __shared__ double shared_memory[];         \
    type *name = (type *)shared_memory
#define PHASE(t) for (int t = threadIdx.x, once_##t = 1; once_##t; once_##t = 0, __syncthreads())
#define KERNEL(name, type) extern "C" __global__ void __launch_bounds__(THREADS) name(const __grid_constant__ struct type a)
#endif

typedef unsigned int u32;
typedef unsigned char u8;
typedef long long i64;

// The number of something that does not exist.
#define NONE 0xffffffffu

// The number of the thread t in its launch.
#define ITEM(t) ((i64)BLOCK * THREADS + (t))
