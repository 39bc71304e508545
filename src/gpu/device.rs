//! The device: its memory, and the launches of its kernels. Foreign code is called here alone.
#![allow(unsafe_code)]

use crate::space::vector::CHUNK;
use bytemuck::Pod;
use cudarc::driver::sys::{self, CUfunction_attribute};
use cudarc::driver::{
    CudaContext, CudaFunction, CudaModule, CudaSlice, CudaStream, DevicePtr, DeviceRepr, DriverError, LaunchConfig,
    PushKernelArg,
};
use cudarc::nvrtc::Ptx;
use rustc_hash::FxHashMap;
use std::fmt::{Debug, Formatter};
use std::marker::PhantomData;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The kernels of `kernels/kernels.cu`.
const KERNELS: &str = include_str!("kernels/kernels.ptx");

/// Bytes of shared memory of a thread block that sums a chunk of a vector: the chunk, and eight accumulators.
pub(super) const SHARED_SUM: usize = size_of::<[f64; CHUNK + 8]>();

/// Threads of a thread block, in every kernel (`kernels/language.h`).
pub(crate) const THREADS: usize = 128;

/// Bytes of shared memory that a thread block has without asking.
const SHARED: usize = 48 << 10;

/// The least compute capability, major version.
const LEAST_CAPABILITY: i32 = 8;

/// A failure of the device or its driver.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GpuError {
    /// There is no driver.
    #[error("--gpu: no NVIDIA driver was found (libcuda.so); run without --gpu, or install the driver")]
    NoDriver,
    /// There is a driver, but no device.
    #[error("--gpu: the NVIDIA driver finds no device ({0})")]
    NoDevice(String),
    /// The device is too old.
    #[error("--gpu: {name} has compute capability {major}.{minor}; at least {LEAST_CAPABILITY}.0 is needed")]
    TooOld {
        /// The device.
        name: String,
        /// Its compute capability.
        major: i32,
        /// Its compute capability.
        minor: i32,
    },
    /// A part of the simulation does not run on a device.
    #[error("--gpu: {part} not run on a GPU yet; {cure}, or run without --gpu")]
    NotYet {
        /// The part, as the subject of a sentence.
        part: &'static str,
        /// The way out.
        cure: &'static str,
    },
    /// The scene does not fit into the device's memory.
    #[error(
        "the GPU has no room for {bytes} more bytes, {free} of {total} are free: take fewer particles, or run without --gpu"
    )]
    Memory {
        /// Bytes asked for.
        bytes: usize,
        /// Bytes that are free.
        free: usize,
        /// Bytes of the device.
        total: usize,
    },
    /// A call of the driver failed.
    #[error("the GPU failed in {call}: {error}; the state before this step is kept, continue it with --restart")]
    Driver {
        /// The call.
        call: String,
        /// The driver's name of the error.
        error: String,
    },
}

/// Memory that is not in use. All launches and copies are in one order, so memory is used again at once.
type Free = Arc<Mutex<Vec<CudaSlice<u8>>>>;

/// A device. The first failure is kept, and nothing is done after it: [`Self::check`] returns it.
pub struct Gpu {
    stream: Arc<CudaStream>,
    module: Arc<CudaModule>,
    /// The kernels that were used so far, with the shared memory that each may have.
    functions: Mutex<FxHashMap<&'static str, (CudaFunction, usize)>>,
    failure: Mutex<Option<GpuError>>,
    /// Memory for partial sums.
    partial: Mutex<Option<Buffer<f64>>>,
    /// Memory that is not in use. The driver would give it back to the system whenever the processor waits for a sum.
    free: Free,
    name: String,
}

impl Debug for Gpu {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "Gpu({})", self.name)
    }
}

/// The contents of a mutex. No code that holds one panics.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn is_out_of_memory(memory: &Result<CudaSlice<u8>, DriverError>) -> bool {
    memory.as_ref().is_err_and(|error| error.0 == sys::CUresult::CUDA_ERROR_OUT_OF_MEMORY)
}

fn name_of(error: DriverError) -> String {
    let named = error.error_name().ok().and_then(|name| name.to_str().ok().map(str::to_owned));
    named.unwrap_or_else(|| format!("error {}", error.0 as u32))
}

impl Gpu {
    /// The first device of this machine, with the kernels loaded.
    ///
    /// # Errors
    /// There is no driver or no device, or the device is too old.
    pub fn open() -> Result<Self, GpuError> {
        // SAFETY: the driver's library is looked for by its name; nothing in it is called.
        if !unsafe { sys::is_culib_present() } {
            return Err(GpuError::NoDriver);
        }
        let missing = |error| GpuError::NoDevice(name_of(error));
        let context = CudaContext::new(0).map_err(missing)?;
        // SAFETY: there is one stream, so no event has to order the uses of memory.
        unsafe { context.disable_event_tracking() };
        let name = context.name().map_err(missing)?;
        let (major, minor) = context.compute_capability().map_err(missing)?;
        if major < LEAST_CAPABILITY {
            return Err(GpuError::TooOld { name, major, minor });
        }
        let failed = |error| GpuError::Driver { call: "loading the kernels".to_owned(), error: name_of(error) };
        let module = context.load_module(Ptx::from_src(KERNELS)).map_err(failed)?;
        let stream = context.default_stream();
        let (functions, failure, partial) = (Mutex::default(), Mutex::default(), Mutex::default());
        Ok(Self { stream, module, functions, failure, partial, free: Free::default(), name })
    }

    /// The name of the device.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Free and all bytes of the device's memory.
    pub(crate) fn memory(&self) -> (usize, usize) {
        self.stream.context().mem_get_info().unwrap_or((0, 0))
    }

    /// The first failure since the last call.
    ///
    /// # Errors
    /// A call of the driver failed. Vectors and results since then mean nothing.
    pub fn check(&self) -> Result<(), GpuError> {
        locked(&self.failure).clone().map_or(Ok(()), Err)
    }

    fn has_failed(&self) -> bool {
        locked(&self.failure).is_some()
    }

    /// Keeps the first failure.
    fn keep<T>(&self, call: &str, result: Result<T, DriverError>) -> Option<T> {
        let error = match result {
            Ok(value) => return Some(value),
            Err(error) => error,
        };
        let failure = GpuError::Driver { call: call.to_owned(), error: name_of(error) };
        locked(&self.failure).get_or_insert(failure);
        None
    }

    /// Memory whose contents are unspecified.
    pub(crate) fn memory_for<T: Pod>(&self, len: usize) -> Buffer<T> {
        let bytes = (len * size_of::<T>()).max(1);
        let memory = if self.has_failed() { None } else { self.allocate(bytes) };
        Buffer { memory, len, free: self.free.clone(), of: PhantomData }
    }

    fn allocate(&self, bytes: usize) -> Option<CudaSlice<u8>> {
        let mut free = locked(&self.free);
        // No more than an eighth of it stays without use.
        let fitting = (0..free.len()).filter(|&at| (bytes..=bytes + bytes / 8).contains(&free[at].len()));
        if let Some(at) = fitting.min_by_key(|&at| free[at].len()) {
            return Some(free.swap_remove(at));
        }
        // SAFETY: any bytes are numbers of the plain types that buffers hold, and whoever takes a buffer writes it first.
        let mut memory = unsafe { self.stream.alloc::<u8>(bytes) };
        if is_out_of_memory(&memory) && !free.is_empty() {
            free.clear();
            _ = self.keep("synchronisation", self.stream.synchronize());
            // SAFETY: as above.
            memory = unsafe { self.stream.alloc::<u8>(bytes) };
        }
        if is_out_of_memory(&memory) {
            let (free, total) = self.memory();
            locked(&self.failure).get_or_insert(GpuError::Memory { bytes, free, total });
        }
        self.keep("an allocation", memory)
    }

    /// A copy of the numbers on the device.
    pub(crate) fn copy_of<T: Pod>(&self, numbers: &[T]) -> Buffer<T> {
        let mut buffer = self.memory_for(numbers.len());
        self.write_at(numbers, &mut buffer, 0);
        buffer
    }

    /// Writes numbers into a buffer, from an index on. They have room there.
    pub(crate) fn write_at<T: Pod>(&self, numbers: &[T], buffer: &mut Buffer<T>, at: usize) {
        if let Some(memory) = buffer.memory.as_mut().filter(|_| !numbers.is_empty() && !self.has_failed()) {
            let bytes: &[u8] = bytemuck::cast_slice(numbers);
            let from = size_of::<T>() * at;
            let mut part = memory.slice_mut(from..from + bytes.len());
            _ = self.keep("a copy to the device", self.stream.memcpy_htod(bytes, &mut part));
        }
    }

    /// Reads numbers from a buffer, from an index on. They exist there. After a failure the numbers stay unchanged.
    pub(crate) fn read_at<T: Pod>(&self, buffer: &Buffer<T>, at: usize, numbers: &mut [T]) {
        let Some(memory) = buffer.memory.as_ref().filter(|_| !numbers.is_empty() && !self.has_failed()) else { return };
        let from = size_of::<T>() * at;
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(numbers);
        let copied = self.stream.memcpy_dtoh(&memory.slice(from..from + bytes.len()), bytes);
        // The copy may still be under way.
        _ = self.keep("a copy from the device", copied.and_then(|()| self.stream.synchronize()));
    }

    /// Calls `fill` with memory for `count` partial sums and their sum, adds them, and returns the sum; NaN after a failure.
    pub(super) fn sum(&self, count: usize, fill: impl FnOnce(u64)) -> f64 {
        let mut partial = locked(&self.partial);
        if partial.as_ref().is_none_or(|partial| partial.len() <= count) {
            *partial = Some(self.memory_for(2 * count + 1));
        }
        let Some(partial) = partial.as_ref().filter(|_| count > 0) else { return 0.0 };
        fill(partial.address());
        self.launch("add_partial", 1, SHARED_SUM, &Sum { partial: partial.address(), count: count as i64 });
        let mut sum = [f64::NAN];
        self.read_at(partial, count, &mut sum);
        sum[0]
    }

    /// Sets all bytes of a buffer to zero.
    pub(crate) fn clear<T: Pod>(&self, buffer: &mut Buffer<T>) {
        let bytes = buffer.len * size_of::<T>();
        if let Some(memory) = buffer.memory.as_mut().filter(|_| bytes > 0 && !self.has_failed()) {
            _ = self.keep("clearing memory", self.stream.memset_zeros(&mut memory.slice_mut(..bytes)));
        }
    }

    /// Copies one buffer into another of the same length.
    pub(crate) fn copy<T: Pod>(&self, from: &Buffer<T>, to: &mut Buffer<T>) {
        let bytes = from.len.min(to.len) * size_of::<T>();
        if let (Some(from), Some(to), false) = (&from.memory, &mut to.memory, bytes == 0 || self.has_failed()) {
            let (from, mut to) = (from.slice(..bytes), to.slice_mut(..bytes));
            _ = self.keep("a copy on the device", self.stream.memcpy_dtod(&from, &mut to));
        }
    }

    /// Launches `blocks` thread blocks of a kernel, each with `shared` bytes of shared memory. The callers, which are the files of this room,
    /// take all addresses in the arguments from buffers, with room for what the kernel writes. Memory that is given back is used again by
    /// later launches only.
    pub(super) fn launch<T: Copy>(&self, kernel: &'static str, blocks: usize, shared: usize, arguments: &T) {
        if blocks == 0 || self.has_failed() {
            return;
        }
        let Some(function) = self.function(kernel, shared) else { return };
        let grid_dim = (blocks as u32, 1, 1);
        let config = LaunchConfig { grid_dim, block_dim: (THREADS as u32, 1, 1), shared_mem_bytes: shared as u32 };
        let argument = Argument(*arguments);
        let mut launch = self.stream.launch_builder(&function);
        launch.arg(&argument);
        // SAFETY: the argument has the layout of the kernel's, and its addresses are those of buffers.
        _ = self.keep(kernel, unsafe { launch.launch(config) });
    }

    /// Launches a kernel with a thread for each of `items`.
    pub(super) fn launch_for<T: Copy>(&self, kernel: &'static str, items: usize, arguments: &T) {
        self.launch(kernel, items.div_ceil(THREADS), 0, arguments);
    }

    /// A kernel that may have so much shared memory.
    fn function(&self, kernel: &'static str, shared: usize) -> Option<CudaFunction> {
        let mut functions = locked(&self.functions);
        if !functions.contains_key(kernel) {
            functions.insert(kernel, (self.keep(kernel, self.module.load_function(kernel))?, SHARED));
        }
        let (function, allowed) = functions.get_mut(kernel)?;
        if shared > *allowed {
            let attribute = CUfunction_attribute::CU_FUNC_ATTRIBUTE_MAX_DYNAMIC_SHARED_SIZE_BYTES;
            self.keep(kernel, function.set_attribute(attribute, shared as i32))?;
            *allowed = shared;
        }
        Some(function.clone())
    }
}

/// The argument of a kernel.
#[repr(transparent)]
struct Argument<T>(T);

// SAFETY: plain data, with the layout of the struct in the kernel's source.
unsafe impl<T: Copy> DeviceRepr for Argument<T> {}

/// `Sum` of `kernels/vectors.h`.
#[derive(Clone, Copy)]
#[repr(C)]
struct Sum {
    partial: u64,
    count: i64,
}

/// Numbers in the device's memory.
#[derive(Debug)]
pub(crate) struct Buffer<T> {
    /// `None` if the device had failed before.
    memory: Option<CudaSlice<u8>>,
    len: usize,
    free: Free,
    of: PhantomData<T>,
}

impl<T> Drop for Buffer<T> {
    fn drop(&mut self) {
        locked(&self.free).extend(self.memory.take());
    }
}

impl<T> Buffer<T> {
    /// Number of numbers.
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// The address on the device; 0 if the device had failed before.
    pub(crate) fn address(&self) -> u64 {
        self.memory.as_ref().map_or(0, |memory| memory.device_ptr(memory.stream()).0)
    }
}
