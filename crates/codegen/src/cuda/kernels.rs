//! Kernels, and how they are called.

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

/// The threads of a warp: fewer in a block would leave some idle.
const WARP: usize = 32;

/// Attributes of a kernel, and options of the driver's assembler, by their numbers in CUDA's header.
const LOCAL_BYTES: c_int = 3;
const REGISTERS: c_int = 4;
const ERROR_LOG: c_int = 5;
const ERROR_LOG_BYTES: c_int = 6;
const LOG: usize = 16 * 1024;

/// What has been compiled and loaded; it stays until all of its kernels are gone.
struct Module {
    device: Device,
    handle: Handle,
}

// SAFETY: modules and their kernels may be used by any thread, also by several at a time.
unsafe impl Send for Module {}
// SAFETY: as above.
unsafe impl Sync for Module {}

impl Drop for Module {
    fn drop(&mut self) {
        if let Ok(_current) = self.device.0.current() {
            let _ = call!(self.device.0.driver, cuCtxSynchronize()); // a kernel of it may be running
            let _ = call!(self.device.0.driver, cuModuleUnload(self.handle));
        }
    }
}

impl Device {
    /// The kernels of some functions, compiled for this device, on numbers of type `T`.
    ///
    /// Where the compiler does not know the device yet, it makes PTX for the newest one that it knows, which the driver goes on with.
    ///
    /// # Errors
    /// [`Error::Compile`] with what the compiler says; [`Error::Load`]; [`Error::Call`].
    ///
    /// # Panics
    /// If `name` is no identifier (ASCII letters, digits and `_`).
    pub fn compile<T: Real>(
        &self,
        compiler: &Compiler,
        name: &str,
        functions: &[Function],
    ) -> Result<Kernels<T>, Error> {
        let image = compiler.image::<T>(name, functions, self.capability())?;
        Kernels::load(self, name, functions, &image)
    }

    /// The kernels of some functions from what a compiler has made of them, PTX or CUBIN: NVRTC is not needed.
    ///
    /// # Safety
    /// `image` is what [`Compiler::ptx`] (or another compiler) made of the same functions, under the same name and for the same `T`,
    /// and whole.
    ///
    /// # Errors
    /// [`Error::Load`] with what the driver says, as where the image is for newer devices; [`Error::Call`].
    pub unsafe fn load<T: Real>(&self, name: &str, functions: &[Function], image: &[u8]) -> Result<Kernels<T>, Error> {
        Kernels::load(self, name, functions, image)
    }
}

/// The kernels of some functions, ready to be called.
#[derive(Debug)]
pub struct Kernels<T: Real> {
    kernels: Vec<Kernel<T>>,
}

impl<T: Real> Kernels<T> {
    pub(super) fn load(device: &Device, name: &str, functions: &[Function], image: &[u8]) -> Result<Self, Error> {
        let (driver, _current) = (&device.0.driver, device.0.current()?);
        let image = [image, &[0]].concat(); // PTX must end with it
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

    /// The kernel of the function of that name.
    ///
    /// # Errors
    /// [`Error::Kernel`] if there is none.
    pub fn kernel(&self, name: &str) -> Result<&Kernel<T>, Error> {
        let known = || self.kernels.iter().map(|k| k.name.clone()).collect();
        let found = self.kernels.iter().find(|kernel| kernel.name == name);
        found.ok_or_else(|| Error::Kernel { name: name.to_owned(), known: known() })
    }
}

/// A function of a robot on a GPU: a thread computes one state, or a share of one.
pub struct Kernel<T: Real> {
    name: String,
    inputs: Vec<Array>,
    outputs: Vec<Array>,
    module: Arc<Module>,
    handle: Handle,
    /// The threads that can compute a state, in as many rows of blocks.
    shares: usize,
    /// The states up to which they do.
    most_shared: usize,
    /// As many threads in a block as keep the most warps on a multiprocessor.
    threads: usize,
    registers: usize,
    local_bytes: usize,
    number: PhantomData<T>,
}

// SAFETY: as for the module.
unsafe impl<T: Real> Send for Kernel<T> {}
// SAFETY: as above.
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
        let shares = function.shares(T::LANGUAGE);
        Ok(Self {
            name: function.name.clone(),
            inputs: function.inputs.clone(),
            outputs: function.outputs.clone(),
            module: module.clone(),
            handle,
            shares,
            most_shared: if function.shares.is_some() { usize::MAX } else { at_a_time / shares },
            threads,
            registers: attribute(REGISTERS)?,
            local_bytes: attribute(LOCAL_BYTES)?,
            number: PhantomData,
        })
    }

    /// The arrays that it reads.
    pub fn inputs(&self) -> &[Array] {
        &self.inputs
    }

    /// The arrays that it fills.
    pub fn outputs(&self) -> &[Array] {
        &self.outputs
    }

    /// The threads that compute a state, each some of the results, where there are few states: [`Function::shares`].
    pub fn shares(&self) -> usize {
        self.shares
    }

    /// The registers of a thread.
    pub fn registers(&self) -> usize {
        self.registers
    }

    /// The memory of a thread, in bytes, for what does not fit into registers.
    pub fn local_bytes(&self) -> usize {
        self.local_bytes
    }

    /// The most states that a call takes: the places in the largest array are numbers of 32 bits.
    pub fn most_states(&self) -> usize {
        let largest = self.inputs.iter().chain(&self.outputs).map(Array::len).max().unwrap_or(1);
        i32::MAX as usize / largest.max(1)
    }

    /// Computes n states, on a stream: returns at once, and what is put into the stream afterwards finds the results.
    ///
    /// Number k of state i of an array stands at `[k * n + i]`; numbers of matrices are counted column by column. All numbers of all
    /// outputs are filled.
    ///
    /// # Errors
    /// [`Error::Arrays`], [`Error::Length`], [`Error::States`] and [`Error::OtherDevice`] for wrong arguments; [`Error::Call`] if
    /// the kernel cannot be launched.
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
        let rows = if n > self.most_shared { 1 } else { self.shares };
        let threads = self.threads_for(rows * n);
        let blocks = n.div_ceil(threads) as c_uint;
        let (_current, rows, threads) = (device.0.current()?, rows as c_uint, threads as c_uint);
        call!(
            device.0.driver,
            cuLaunchKernel(self.handle, blocks, rows, 1, threads, 1, 1, 0, stream.handle, parameters.as_ptr(), null())
        )
    }

    /// The threads of a block, of n in all: fewer than the best for many where these would leave multiprocessors idle.
    fn threads_for(&self, n: usize) -> usize {
        let share = n.div_ceil(self.module.device.0.multiprocessors).next_multiple_of(WARP);
        share.min(self.threads)
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
