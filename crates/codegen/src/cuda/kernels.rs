//! Kernels and their calls.

use super::array::{DeviceArray, Real, on_device};
use super::compiler::Compiler;
use super::device::{Device, Stream};
use super::driver::{Handle, call};
use super::error::Error;
use crate::function::{Array, Function};
use core::ffi::{c_int, c_uint, c_void};
use core::fmt;
use core::marker::PhantomData;
use core::ptr::{null, null_mut};
use std::ffi::CString;
use std::sync::Arc;

/// Number of threads in a warp. A smaller block would leave some threads of the warp idle.
const WARP: usize = 32;

/// Identifiers of a kernel's attributes and of options of the driver's assembler, from CUDA's header.
const LOCAL_BYTES: c_int = 3;
const REGISTERS: c_int = 4;
const ERROR_LOG: c_int = 5;
const ERROR_LOG_BYTES: c_int = 6;
const LOG: usize = 16 * 1024;

/// Compiled and loaded code. The code stays loaded until all of its kernels are dropped.
struct Module {
    device: Device,
    handle: Handle,
}

// SAFETY: any thread may use modules and their kernels, also several threads at the same time.
unsafe impl Send for Module {}
// SAFETY: any thread may use modules and their kernels, also several threads at the same time.
unsafe impl Sync for Module {}

impl Drop for Module {
    fn drop(&mut self) {
        if let Ok(_current) = self.device.0.current() {
            let _ = call!(self.device.0.driver, cuCtxSynchronize()); // a kernel of the module may still be running
            let _ = call!(self.device.0.driver, cuModuleUnload(self.handle));
        }
    }
}

impl Device {
    /// Compiles the kernels of the functions for this device, with numbers of type `T`.
    ///
    /// If the compiler does not know the device, the compiler makes PTX (intermediate code) for the newest device that
    /// it knows. The driver then compiles this PTX.
    ///
    /// # Errors
    /// [`Error::Compile`] with the compiler's log; [`Error::Load`]; [`Error::Call`].
    ///
    /// # Panics
    /// If `name` is not an identifier (ASCII letters, digits and `_`).
    pub fn compile<T: Real>(
        &self,
        compiler: &Compiler,
        name: &str,
        functions: &[Function],
    ) -> Result<Kernels<T>, Error> {
        let image = compiler.image::<T>(name, functions, self.capability())?;
        Kernels::load(self, name, functions, &image)
    }

    /// Loads the kernels of the functions from PTX or CUBIN that a compiler made earlier. Loading does not need
    /// NVIDIA's run-time compiler.
    ///
    /// # Safety
    /// `image` must be the complete output of [`Compiler::ptx`] (or of another compiler) for the same functions, the
    /// same name and the same `T`.
    ///
    /// # Errors
    /// [`Error::Load`] with the driver's message, for example if the image is for newer devices; [`Error::Call`].
    pub unsafe fn load<T: Real>(&self, name: &str, functions: &[Function], image: &[u8]) -> Result<Kernels<T>, Error> {
        Kernels::load(self, name, functions, image)
    }
}

/// Kernels of a robot's functions, ready to be called.
#[derive(Debug)]
pub struct Kernels<T: Real> {
    kernels: Vec<Kernel<T>>,
}

impl<T: Real> Kernels<T> {
    pub(super) fn load(device: &Device, name: &str, functions: &[Function], image: &[u8]) -> Result<Self, Error> {
        let (driver, _current) = (&device.0.driver, device.0.current()?);
        let image = [image, &[0]].concat(); // PTX must end with 0
        let mut log = vec![0_u8; LOG];
        let values: [*mut c_void; 2] = [log.as_mut_ptr().cast(), LOG as *mut c_void];
        let (options, mut handle) = ([ERROR_LOG, ERROR_LOG_BYTES], null_mut());
        let from = image.as_ptr().cast();
        call!(driver, cuModuleLoadDataEx(&raw mut handle, from, 2, options.as_ptr(), values.as_ptr())).map_err(
            |error| match error {
                Error::Call { text, .. } => {
                    let end = log.iter().position(|&c| c == 0).unwrap_or(LOG);
                    let log = String::from_utf8_lossy(&log[..end]).into_owned();
                    Error::Load { name: name.to_owned(), text, log }
                }
                other => other,
            },
        )?;
        let module = Arc::new(Module { device: device.clone(), handle });
        let kernels = functions.iter().map(|f| Kernel::new(&module, name, f)).collect::<Result<_, _>>()?;
        Ok(Self { kernels })
    }

    /// Returns the kernel of the function with this name.
    ///
    /// # Errors
    /// [`Error::Kernel`] if no kernel has this name.
    pub fn kernel(&self, name: &str) -> Result<&Kernel<T>, Error> {
        let known = || self.kernels.iter().map(|k| k.name.clone()).collect();
        let found = self.kernels.iter().find(|kernel| kernel.name == name);
        found.ok_or_else(|| Error::Kernel { name: name.to_owned(), known: known() })
    }
}

/// Function of a robot on a GPU. Each thread computes one state, or a partition of one state.
pub struct Kernel<T: Real> {
    name: String,
    inputs: Vec<Array>,
    outputs: Vec<Array>,
    module: Arc<Module>,
    handle: Handle,
    /// Number of threads that can compute one state together. Each of these threads is in a separate row of blocks.
    partitions: usize,
    /// Maximum number of states for which a call splits each state among `partitions` threads.
    most_partitioned: usize,
    /// Number of threads in a block, chosen to run as many warps as possible on a multiprocessor at the same time.
    threads: usize,
    registers: usize,
    local_bytes: usize,
    number: PhantomData<T>,
}

// SAFETY: any thread may use modules and their kernels, also several threads at the same time.
unsafe impl<T: Real> Send for Kernel<T> {}
// SAFETY: any thread may use modules and their kernels, also several threads at the same time.
unsafe impl<T: Real> Sync for Kernel<T> {}

impl<T: Real> fmt::Debug for Kernel<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names = |arrays: &[Array]| arrays.iter().map(|a| a.name.clone()).collect::<Vec<_>>().join(", ");
        write!(f, "{}({}) -> {}", self.name, names(&self.inputs), names(&self.outputs))
    }
}

impl<T: Real> Kernel<T> {
    fn new(module: &Arc<Module>, code: &str, function: &Function) -> Result<Self, Error> {
        let driver = &module.device.0.driver;
        let symbol =
            CString::new(format!("{}_{}", T::LANGUAGE.stem(code), function.name)).expect("identifiers have no zeros");
        let (mut handle, mut blocks, mut threads) = (null_mut(), 0, 0);
        call!(driver, cuModuleGetFunction(&raw mut handle, module.handle, symbol.as_ptr()))?;
        call!(driver, cuOccupancyMaxPotentialBlockSize(&raw mut blocks, &raw mut threads, handle, null(), 0, 0))?;
        let attribute = |attribute| {
            let mut value = 0;
            call!(driver, cuFuncGetAttribute(&raw mut value, attribute, handle))?;
            Ok::<_, Error>(usize::try_from(value).unwrap_or(0))
        };
        let threads = usize::try_from(threads).unwrap_or(0).max(WARP);
        let at_a_time = threads * usize::try_from(blocks).unwrap_or(0);
        let partitions = function.partitions(T::LANGUAGE);
        Ok(Self {
            name: function.name.clone(),
            inputs: function.inputs.clone(),
            outputs: function.outputs.clone(),
            module: module.clone(),
            handle,
            partitions,
            most_partitioned: if function.partitions.is_some() { usize::MAX } else { at_a_time / partitions },
            threads,
            registers: attribute(REGISTERS)?,
            local_bytes: attribute(LOCAL_BYTES)?,
            number: PhantomData,
        })
    }

    /// Returns the input arrays.
    pub fn inputs(&self) -> &[Array] {
        &self.inputs
    }

    /// Returns the output arrays.
    pub fn outputs(&self) -> &[Array] {
        &self.outputs
    }

    /// Returns the number of threads that compute one state together if a call has few states; see
    /// [`Function::partitions`].
    pub fn partitions(&self) -> usize {
        self.partitions
    }

    /// Returns the number of registers per thread.
    pub fn registers(&self) -> usize {
        self.registers
    }

    /// Returns the size of a thread's local memory (bytes), which holds values that do not fit into registers.
    pub fn local_bytes(&self) -> usize {
        self.local_bytes
    }

    /// Returns the maximum number of states in a call. It is limited because indices in the largest array have 32 bits.
    pub fn most_states(&self) -> usize {
        let largest = self.inputs.iter().chain(&self.outputs).map(Array::len).max().unwrap_or(1);
        i32::MAX as usize / largest.max(1)
    }

    /// Launches the kernel on a stream, for n states. The function returns at once. Later work in the same stream can
    /// use the results.
    ///
    /// Number k of state i is stored at index `[k * n + i]` of its array; matrices are stored column by column. The
    /// call writes all numbers of all outputs.
    ///
    /// # Errors
    /// [`Error::Arrays`], [`Error::Length`], [`Error::States`] and [`Error::OtherDevice`] for wrong arguments;
    /// [`Error::Call`] if the kernel cannot be launched.
    pub fn call(
        &self,
        stream: &Stream,
        n: usize,
        inputs: &[&DeviceArray<T>],
        outputs: &mut [&mut DeviceArray<T>],
    ) -> Result<(), Error> {
        let device = &self.module.device;
        on_device("stream", device, &stream.device)?;
        if n > self.most_states() {
            return Err(Error::States { kernel: self.name.clone(), most: self.most_states(), found: n });
        }
        self.check("inputs", &self.inputs, n, inputs.iter().copied(), inputs.len())?;
        self.check("outputs", &self.outputs, n, outputs.iter().map(|o| &**o), outputs.len())?;
        if n == 0 {
            return Ok(());
        }
        let mut states = n as c_int;
        let mut addresses: Vec<u64> =
            inputs.iter().map(|a| a.address).chain(outputs.iter().map(|a| a.address)).collect();
        let mut parameters = vec![(&raw mut states).cast::<c_void>()];
        parameters.extend(addresses.iter_mut().map(|a| (&raw mut *a).cast()));
        let rows = if n > self.most_partitioned { 1 } else { self.partitions };
        let threads = self.threads_for(rows * n);
        let blocks = n.div_ceil(threads) as c_uint;
        let (_current, rows, threads) = (device.0.current()?, rows as c_uint, threads as c_uint);
        call!(
            device.0.driver,
            cuLaunchKernel(self.handle, blocks, rows, 1, threads, 1, 1, 0, stream.handle, parameters.as_ptr(), null())
        )
    }

    /// Returns the number of threads per block for n threads in total. This number is less than `self.threads` if such
    /// large blocks would leave multiprocessors idle.
    fn threads_for(&self, n: usize) -> usize {
        let portion = n.div_ceil(self.module.device.0.multiprocessors).next_multiple_of(WARP);
        portion.min(self.threads)
    }

    fn check<'a>(
        &self,
        kind: &'static str,
        expected: &[Array],
        n: usize,
        given: impl Iterator<Item = &'a DeviceArray<T>>,
        count: usize,
    ) -> Result<(), Error> {
        if count != expected.len() {
            let (kernel, expected) = (self.name.clone(), expected.len());
            return Err(Error::Arrays { kernel, arrays: kind, expected, found: count });
        }
        for (array, given) in expected.iter().zip(given) {
            on_device(&array.name, &self.module.device, &given.device)?;
            if given.len() != array.len() * n {
                let (array, expected) = (array.name.clone(), array.len() * n);
                return Err(Error::Length { array, expected, found: given.len() });
            }
        }
        Ok(())
    }
}
