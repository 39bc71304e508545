//! The device: its memory, and the launches of its kernels. Foreign code is called here alone.
#![allow(unsafe_code)]

use crate::parallel::held;
use crate::space::vector::CHUNK;
use bytemuck::Pod;
use cudarc::driver::sys::{self, CUfunction_attribute};
use cudarc::driver::{
    CudaContext, CudaFunction, CudaModule, CudaSlice, CudaStream, DevicePtr, DeviceRepr, DriverError, LaunchConfig,
    PushKernelArg, ValidAsZeroBits, result,
};
use cudarc::nvrtc::Ptx;
use rustc_hash::FxHashMap;
use std::fmt::{Debug, Formatter};
use std::sync::{Arc, Mutex, MutexGuard};

/// The kernels of `kernels/kernels.cu`.
const KERNELS: &str = include_str!("kernels/kernels.ptx");

/// Bytes of shared memory of a thread block that sums a chunk of a vector: the chunk, and eight accumulators.
pub(super) const SHARED_SUM: usize = size_of::<[f64; CHUNK + 8]>();

/// Threads of a thread block, in every kernel (`kernels/language.h`).
pub(crate) const THREADS: usize = 128;

/// Bytes of shared memory that a thread block has without asking.
const SHARED: usize = 48 << 10;

/// The least version of the driver: CUDA 12.0.
const LEAST_DRIVER: i32 = 12_000;

/// The least compute capability, major version.
const LEAST_CAPABILITY: i32 = 8;

/// The argument of a kernel: a struct with the layout and the names of that in the kernel's source.
macro_rules! arguments {
    ($($field:ident $(: $value:expr)?),+ $(,)?) => {{
        #[derive(Clone, Copy)]
        #[repr(C)]
        #[allow(non_camel_case_types)]
        struct Arguments<$($field),+> {
            $($field: $field),+
        }
        Arguments { $($field $(: $value)?),+ }
    }};
}
pub(super) use arguments;

/// A failure of the device or its driver.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GpuError {
    /// There is no driver.
    #[error("--gpu: no NVIDIA driver was found (libcuda.so); run without --gpu, or install the driver")]
    NoDriver,
    /// There is a driver, but no device.
    #[error("--gpu: the NVIDIA driver finds no device ({0})")]
    NoDevice(String),
    /// The driver is too old.
    #[error("--gpu: the NVIDIA driver is for CUDA {major}.{minor}; at least 12.0 is needed (driver 525)")]
    OldDriver {
        /// The version of CUDA that the driver knows.
        major: i32,
        /// The version of CUDA that the driver knows.
        minor: i32,
    },
    /// The device does not take the kernels.
    #[error("--gpu: the driver cannot load the kernels ({0}); run without --gpu")]
    NoKernels(String),
    /// A block of cells has more nodes than fit into the memory that its threads share.
    #[error(
        "--gpu: a block of cells needs {needed} bytes of shared memory, and {name} has {most}; take narrower shape functions \
         (a larger gamma), or run without --gpu"
    )]
    Shared {
        /// The device.
        name: String,
        /// Bytes needed.
        needed: usize,
        /// Bytes that the device has.
        most: usize,
    },
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
    /// A vector is shorter than the operator is large.
    #[error("a vector on the GPU has {found} numbers, and the operator needs {needed}")]
    Length {
        /// Numbers needed.
        needed: usize,
        /// Numbers of the shorter vector.
        found: usize,
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

/// A device. The first failure is kept, and nothing is done after it: [`Self::check`] returns it.
pub struct Gpu {
    stream: Arc<CudaStream>,
    module: Arc<CudaModule>,
    /// The kernels that were used so far, with the shared memory that each may have.
    functions: Mutex<FxHashMap<&'static str, (CudaFunction, usize)>>,
    failure: Mutex<Option<GpuError>>,
    /// Memory for partial sums, on both sides.
    partial: Mutex<(Option<Buffer<f64>>, Vec<f64>)>,
    /// Held while several launches share memory.
    in_use: Mutex<()>,
    /// Bytes of shared memory that a thread block may have.
    most_shared: usize,
    name: String,
}

impl Debug for Gpu {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "Gpu({})", self.name)
    }
}

/// Lets the driver keep freed memory for later allocations. Otherwise it gives it back whenever the processor waits for a sum.
fn keep_memory(context: &CudaContext) -> Result<(), DriverError> {
    if !context.has_async_alloc() {
        return Ok(());
    }
    let mut all = u64::MAX;
    // SAFETY: the device is that of a context, its pool lives as long as the device, and the attribute is a number of 64 bits.
    unsafe {
        let pool = result::device::get_default_mem_pool(context.cu_device())?;
        let attribute = sys::CUmemPool_attribute::CU_MEMPOOL_ATTR_RELEASE_THRESHOLD;
        result::mem_pool::set_attribute(pool, attribute, (&raw mut all).cast())
    }
}

fn name_of(error: DriverError) -> String {
    let named = error.error_name().ok().and_then(|name| name.to_str().ok().map(str::to_owned));
    named.unwrap_or_else(|| format!("error {}", error.0 as u32))
}

impl Gpu {
    /// The first device of this machine, with the kernels loaded.
    ///
    /// # Errors
    /// There is no driver or no device, or one of them is too old.
    pub fn open() -> Result<Self, GpuError> {
        // SAFETY: the driver's library is looked for by its name; nothing in it is called.
        if !unsafe { sys::is_culib_present() } {
            return Err(GpuError::NoDriver);
        }
        let mut version = 0;
        // SAFETY: the driver writes its version.
        _ = unsafe { sys::cuDriverGetVersion(&raw mut version) };
        if version < LEAST_DRIVER {
            return Err(GpuError::OldDriver { major: version / 1000, minor: version % 1000 / 10 });
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
        keep_memory(&context).map_err(missing)?;
        let attribute = sys::CUdevice_attribute::CU_DEVICE_ATTRIBUTE_MAX_SHARED_MEMORY_PER_BLOCK_OPTIN;
        let most_shared = context.attribute(attribute).map_err(missing)?.max(0) as usize;
        let failed = |error| GpuError::NoKernels(name_of(error));
        let module = context.load_module(Ptx::from_src(KERNELS)).map_err(failed)?;
        let (functions, failure, partial, in_use) =
            (Mutex::default(), Mutex::default(), Mutex::default(), Mutex::default());
        Ok(Self { stream: context.default_stream(), module, functions, failure, partial, in_use, most_shared, name })
    }

    /// The name of the device.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Free and all bytes of the device's memory; `None` if the driver does not tell.
    pub(crate) fn memory(&self) -> Option<(usize, usize)> {
        self.stream.context().mem_get_info().ok()
    }

    /// Whether thread blocks may have so much shared memory.
    ///
    /// # Errors
    /// The device has less.
    pub(crate) fn check_shared(&self, needed: usize) -> Result<(), GpuError> {
        let (name, most) = (self.name.clone(), self.most_shared);
        if needed <= most { Ok(()) } else { Err(GpuError::Shared { name, needed, most }) }
    }

    /// The first failure. After it, nothing is done on this device any more.
    ///
    /// # Errors
    /// A call of the driver failed. Vectors and results since then mean nothing.
    pub fn check(&self) -> Result<(), GpuError> {
        held(&self.failure).clone().map_or(Ok(()), Err)
    }

    /// Keeps the failure, if it is the first one.
    pub(super) fn keep_failure(&self, result: Result<(), GpuError>) {
        if let Err(failure) = result {
            held(&self.failure).get_or_insert(failure);
        }
    }

    fn has_failed(&self) -> bool {
        held(&self.failure).is_some()
    }

    /// Keeps the first failure.
    fn keep<T>(&self, call: &str, result: Result<T, DriverError>) -> Option<T> {
        let error = match result {
            Ok(value) => return Some(value),
            Err(error) => error,
        };
        let failure = GpuError::Driver { call: call.to_owned(), error: name_of(error) };
        held(&self.failure).get_or_insert(failure);
        None
    }

    /// Memory whose contents are unspecified.
    pub(crate) fn memory_for<T: DeviceNumber>(&self, len: usize) -> Buffer<T> {
        let memory = if self.has_failed() { None } else { self.allocate(len.max(1)) };
        Buffer { memory, len }
    }

    fn allocate<T: DeviceNumber>(&self, len: usize) -> Option<CudaSlice<T>> {
        // SAFETY: any bytes are numbers of the plain types that buffers hold, and whoever takes a buffer writes it first.
        let memory = unsafe { self.stream.alloc(len) };
        if memory.as_ref().is_err_and(|error| error.0 == sys::CUresult::CUDA_ERROR_OUT_OF_MEMORY) {
            let bytes = len * size_of::<T>();
            let (free, total) = self.memory().unwrap_or_default();
            held(&self.failure).get_or_insert(GpuError::Memory { bytes, free, total });
        }
        self.keep("an allocation", memory)
    }

    /// A copy of the numbers on the device.
    pub(crate) fn copy_of<T: DeviceNumber>(&self, numbers: &[T]) -> Buffer<T> {
        let mut buffer = self.memory_for(numbers.len());
        self.write_at(numbers, &mut buffer, 0);
        buffer
    }

    /// Writes numbers into a buffer, from an index on. They have room there.
    pub(crate) fn write_at<T: DeviceNumber>(&self, numbers: &[T], buffer: &mut Buffer<T>, at: usize) {
        if let Some(memory) = buffer.memory.as_mut().filter(|_| !numbers.is_empty() && !self.has_failed()) {
            let copied = self.stream.memcpy_htod(numbers, &mut memory.slice_mut(at..at + numbers.len()));
            // The numbers may go away before the copy is made.
            _ = self.keep("a copy to the device", copied.and_then(|()| self.stream.synchronize()));
        }
    }

    /// Reads numbers from a buffer, from an index on. They exist there. After a failure the numbers stay unchanged.
    pub(crate) fn read_at<T: DeviceNumber>(&self, buffer: &Buffer<T>, at: usize, numbers: &mut [T]) {
        let Some(memory) = buffer.memory.as_ref().filter(|_| !numbers.is_empty() && !self.has_failed()) else { return };
        let copied = self.stream.memcpy_dtoh(&memory.slice(at..at + numbers.len()), numbers);
        // The copy may still be under way.
        _ = self.keep("a copy from the device", copied.and_then(|()| self.stream.synchronize()));
    }

    /// Copies a buffer to `numbers`, all or none. Returns whether the device has not failed.
    pub(crate) fn read_all<T: DeviceNumber>(&self, buffer: &Buffer<T>, numbers: &mut [T]) -> bool {
        // If a copy fails, a part of its numbers may have been written.
        let mut all = vec![T::zeroed(); numbers.len()];
        self.read_at(buffer, 0, &mut all);
        let succeeded = self.check().is_ok();
        if succeeded {
            numbers.copy_from_slice(&all);
        }
        succeeded
    }

    /// Calls `fill` with memory for `count` partial sums, and adds them in their order; NaN after a failure.
    pub(super) fn sum(&self, count: usize, fill: impl FnOnce(u64)) -> f64 {
        let (on_device, numbers) = &mut *held(&self.partial);
        if on_device.as_ref().is_none_or(|partial| partial.len() < count) {
            *on_device = Some(self.memory_for(count));
        }
        numbers.clear();
        numbers.resize(count, f64::NAN);
        if let Some(partial) = on_device {
            fill(partial.address());
            self.read_at(partial, 0, numbers);
        }
        numbers.iter().sum()
    }

    /// Excludes other threads of the program while several launches share memory.
    pub(super) fn lock(&self) -> MutexGuard<'_, ()> {
        held(&self.in_use)
    }

    /// Sets all bytes of a buffer to zero.
    pub(crate) fn clear<T: DeviceNumber>(&self, buffer: &mut Buffer<T>) {
        let len = buffer.len;
        if let Some(memory) = buffer.memory.as_mut().filter(|_| len > 0 && !self.has_failed()) {
            _ = self.keep("clearing memory", self.stream.memset_zeros(&mut memory.slice_mut(..len)));
        }
    }

    /// Copies one buffer into another of the same length.
    pub(crate) fn copy<T: DeviceNumber>(&self, from: &Buffer<T>, to: &mut Buffer<T>) {
        let len = from.len.min(to.len);
        if let (Some(from), Some(to), false) = (&from.memory, &mut to.memory, len == 0 || self.has_failed()) {
            let (from, mut to) = (from.slice(..len), to.slice_mut(..len));
            _ = self.keep("a copy on the device", self.stream.memcpy_dtod(&from, &mut to));
        }
    }

    /// Launches `blocks` thread blocks of a kernel, each with `shared` bytes of shared memory. The callers, which are the files of this room,
    /// take all addresses in the arguments from buffers, with room for what the kernel writes. The driver frees a buffer after the launches
    /// before.
    pub(super) fn launch<T: Copy>(&self, kernel: &'static str, blocks: usize, shared: usize, arguments: &T) {
        if blocks == 0 || self.has_failed() {
            return;
        }
        let Some(function) = self.function(kernel, shared, size_of::<T>()) else { return };
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

    /// A kernel that may have so much shared memory, and takes an argument of so many bytes.
    fn function(&self, kernel: &'static str, shared: usize, argument: usize) -> Option<CudaFunction> {
        let mut functions = held(&self.functions);
        if !functions.contains_key(kernel) && !KERNELS.contains(&format!(" {kernel}_param_0[{argument}]")) {
            let (call, error) = (kernel.to_owned(), format!("it takes no argument of {argument} bytes"));
            self.keep_failure(Err(GpuError::Driver { call, error }));
            return None;
        }
        self.keep(kernel, self.stream.context().bind_to_thread())?;
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

/// Plain numbers that a device can hold.
pub(crate) trait DeviceNumber: Pod + DeviceRepr + ValidAsZeroBits {}

impl<T: Pod + DeviceRepr + ValidAsZeroBits> DeviceNumber for T {}

/// Numbers in the device's memory.
#[derive(Debug)]
pub(crate) struct Buffer<T> {
    /// `None` if the device had failed before.
    memory: Option<CudaSlice<T>>,
    /// Number of numbers. The memory has at least one.
    len: usize,
}

impl<T> Drop for Buffer<T> {
    fn drop(&mut self) {
        if let Some(memory) = &self.memory {
            // The driver frees memory for the thread that is bound to the device.
            let context = memory.stream().context();
            context.record_err(context.bind_to_thread());
        }
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
