//! The library of NVIDIA's GPU driver.

use super::error::Error;
use super::library::{Named, library_functions};
use core::ffi::{CStr, c_char, c_int, c_uint, c_void};
use core::fmt;
use std::path::Path;
use std::sync::Arc;

/// Handle of a CUDA object: a context, a stream, an event, a module or a kernel.
pub(super) type Handle = *mut c_void;

/// Address in the device's memory.
pub(super) type Address = u64;

library_functions! { DriverTable:
    cuInit(c_uint);
    cuGetErrorName(c_int, *mut *const c_char);
    cuGetErrorString(c_int, *mut *const c_char);
    cuDeviceGetCount(*mut c_int);
    cuDeviceGet(*mut c_int, c_int);
    cuDeviceGetName(*mut c_char, c_int, c_int);
    cuDeviceGetAttribute(*mut c_int, c_int, c_int);
    cuDevicePrimaryCtxRetain(*mut Handle, c_int);
    cuDevicePrimaryCtxRelease_v2(c_int);
    cuCtxPushCurrent_v2(Handle);
    cuCtxPopCurrent_v2(*mut Handle);
    cuCtxSynchronize();
    cuMemAlloc_v2(*mut Address, usize);
    cuMemFree_v2(Address);
    cuMemcpyHtoDAsync_v2(Address, *const c_void, usize, Handle);
    cuMemcpyDtoHAsync_v2(*mut c_void, Address, usize, Handle);
    cuStreamCreate(*mut Handle, c_uint);
    cuStreamDestroy_v2(Handle);
    cuStreamSynchronize(Handle);
    cuStreamWaitEvent(Handle, Handle, c_uint);
    cuEventCreate(*mut Handle, c_uint);
    cuEventDestroy_v2(Handle);
    cuEventRecord(Handle, Handle);
    cuModuleLoadDataEx(*mut Handle, *const c_void, c_uint, *const c_int, *const *mut c_void);
    cuModuleUnload(Handle);
    cuModuleGetFunction(*mut Handle, Handle, *const c_char);
    cuFuncGetAttribute(*mut c_int, c_int, Handle);
    cuOccupancyMaxPotentialBlockSize(*mut c_int, *mut c_int, Handle, *const c_void, usize, c_int);
    cuLaunchKernel(
        Handle, c_uint, c_uint, c_uint, c_uint, c_uint, c_uint, c_uint, Handle, *const *mut c_void, *const *mut c_void
    );
}

/// Calls a function of the driver. Returns `Ok(())`, or an error with the function's name and CUDA's message. The
/// caller guarantees that the arguments are valid.
macro_rules! call {
    ($driver:expr, $function:ident($($argument:expr),* $(,)?)) => {{
        let driver: &$crate::cuda::Driver = &$driver;
        // SAFETY: each handle is valid while its owner exists. Callers pass valid pointers to results, and the correct
        // sizes of the results.
        let status = unsafe { (driver.table.$function)($($argument),*) };
        driver.check(stringify!($function), status)
    }};
}
pub(super) use call;

const LIBRARY: Named = Named {
    library: "CUDA's driver",
    variable: "CONDYLE_CUDA_LIBRARY",
    files: if cfg!(windows) { &["nvcuda.dll"] } else { &["libcuda.so.1", "libcuda.so"] },
};

/// NVIDIA's GPU driver, after it was loaded.
#[derive(Clone)]
pub struct Driver {
    pub(super) table: Arc<DriverTable>,
}

impl fmt::Debug for Driver {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Driver")
    }
}

impl Driver {
    /// Loads the driver from the system's search path, or from the file named by the environment variable
    /// `CONDYLE_CUDA_LIBRARY`.
    ///
    /// ```
    /// use condyle_codegen::cuda::{Driver, Error};
    /// match Driver::new() {
    ///     Ok(driver) => println!("{} devices", driver.devices()?),
    ///     Err(Error::Library { reason, .. }) => println!("no driver: {reason}"),
    ///     Err(other) => println!("{other}"), // a driver, but no device, or no right to use it
    /// }
    /// # Ok::<(), Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Library`] if the driver cannot be loaded; [`Error::Call`] if the driver cannot be used, for example
    /// without a device.
    pub fn new() -> Result<Self, Error> {
        Self::load(None)
    }

    /// Loads the driver from a file.
    ///
    /// # Errors
    /// The errors of [`new`](Self::new).
    pub fn open(library: &Path) -> Result<Self, Error> {
        Self::load(Some(library))
    }

    fn load(library: Option<&Path>) -> Result<Self, Error> {
        let driver = Self { table: Arc::new(DriverTable::load(&LIBRARY, library)?) };
        call!(driver, cuInit(0))?;
        Ok(driver)
    }

    /// Returns the number of devices.
    ///
    /// # Errors
    /// [`Error::Call`].
    pub fn devices(&self) -> Result<usize, Error> {
        let mut count = 0;
        call!(self, cuDeviceGetCount(&raw mut count))?;
        Ok(usize::try_from(count).unwrap_or(0))
    }

    /// Converts the status that a driver function returned to a `Result`.
    pub(super) fn check(&self, function: &'static str, status: c_int) -> Result<(), Error> {
        if status == 0 {
            return Ok(());
        }
        Err(Error::Call { function, status, text: self.text(status) })
    }

    /// Returns the name of a status and CUDA's message.
    fn text(&self, status: c_int) -> String {
        let say = |function: unsafe extern "system" fn(c_int, *mut *const c_char) -> c_int| {
            let mut text = core::ptr::null();
            // SAFETY: the function writes a pointer to a constant string, or null.
            unsafe {
                if function(status, &raw mut text) != 0 || text.is_null() {
                    return "unknown".to_owned();
                }
                CStr::from_ptr(text).to_string_lossy().into_owned()
            }
        };
        format!("{}, {}", say(self.table.cuGetErrorName), say(self.table.cuGetErrorString))
    }
}
