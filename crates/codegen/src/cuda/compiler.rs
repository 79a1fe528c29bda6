//! NVIDIA's run-time compiler (NVRTC).

use super::array::Real;
use super::error::Error;
use super::library::{Named, library_functions};
use crate::function::Function;
use core::ffi::{CStr, c_char, c_int};
use core::fmt;
use core::ptr::{null, null_mut};
use std::ffi::CString;
use std::path::Path;

type Program = *mut core::ffi::c_void;

library_functions! { CompilerTable:
    nvrtcGetNumSupportedArchs(*mut c_int);
    nvrtcGetSupportedArchs(*mut c_int);
    nvrtcCreateProgram(*mut Program, *const c_char, *const c_char, c_int, *const *const c_char, *const *const c_char);
    nvrtcCompileProgram(Program, c_int, *const *const c_char);
    nvrtcGetProgramLogSize(Program, *mut usize);
    nvrtcGetProgramLog(Program, *mut c_char);
    nvrtcGetCUBINSize(Program, *mut usize);
    nvrtcGetCUBIN(Program, *mut c_char);
    nvrtcGetPTXSize(Program, *mut usize);
    nvrtcGetPTX(Program, *mut c_char);
    nvrtcDestroyProgram(*mut Program);
}

const LIBRARY: Named = Named {
    library: "NVIDIA's run-time compiler",
    variable: "CONDYLE_NVRTC_LIBRARY",
    files: if cfg!(windows) {
        &["nvrtc64_130_0.dll", "nvrtc64_120_0.dll"]
    } else {
        &["libnvrtc.so", "libnvrtc.so.13", "libnvrtc.so.12", "/usr/local/cuda/lib64/libnvrtc.so"]
    },
};

/// NVIDIA's run-time compiler, after it was loaded. It needs neither a GPU nor a driver.
pub struct Compiler {
    table: CompilerTable,
}

impl fmt::Debug for Compiler {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Compiler")
    }
}

/// Program of NVRTC. Dropping this object destroys the program.
struct Open<'a>(&'a CompilerTable, Program);

impl Drop for Open<'_> {
    fn drop(&mut self) {
        // SAFETY: the program was created before, and is destroyed only here.
        unsafe { (self.0.nvrtcDestroyProgram)(&raw mut self.1) };
    }
}

impl Open<'_> {
    /// Returns the bytes that `get` writes. `size` returns the number of these bytes.
    ///
    /// # Safety
    /// `get` must write exactly the number of bytes that `size` returns.
    unsafe fn bytes(
        &self,
        size: unsafe extern "system" fn(Program, *mut usize) -> c_int,
        get: unsafe extern "system" fn(Program, *mut c_char) -> c_int,
    ) -> Vec<u8> {
        let mut count = 0;
        // SAFETY: the caller promises that `get` writes as many bytes as `size` returns.
        unsafe {
            if size(self.1, &raw mut count) != 0 {
                return Vec::new();
            }
            let mut bytes = vec![0; count];
            if get(self.1, bytes.as_mut_ptr().cast()) == 0 { bytes } else { Vec::new() }
        }
    }
}

impl Compiler {
    /// Loads the compiler from the system's search path, or from the file named by the environment variable
    /// `CONDYLE_NVRTC_LIBRARY`.
    ///
    /// # Errors
    /// [`Error::Library`] if the compiler cannot be loaded.
    pub fn new() -> Result<Self, Error> {
        Ok(Self { table: CompilerTable::load(&LIBRARY, None)? })
    }

    /// Loads the compiler from a file, such as `libnvrtc.so.12`.
    ///
    /// # Errors
    /// [`Error::Library`] if the compiler cannot be loaded.
    pub fn open(library: &Path) -> Result<Self, Error> {
        Ok(Self { table: CompilerTable::load(&LIBRARY, Some(library))? })
    }

    /// Compiles the kernels of the functions to PTX, NVIDIA's intermediate code. The PTX code runs on all devices with
    /// at least this compute capability, for example (7, 0).
    ///
    /// [`Device::load`](crate::cuda::Device::load) loads the PTX code. The machine that loads the code does not need
    /// the compiler.
    ///
    /// # Errors
    /// [`Error::Compile`] with the compiler's log.
    ///
    /// # Panics
    /// If `name` is not an identifier (ASCII letters, digits and `_`).
    pub fn ptx<T: Real>(&self, name: &str, functions: &[Function], capability: (u32, u32)) -> Result<Vec<u8>, Error> {
        let architecture = format!("compute_{}{}", capability.0, capability.1);
        self.compile(name, &text::<T>(name, functions), &architecture)
    }

    /// Compiles kernels to machine code for devices of this compute capability. If the compiler does not know this
    /// capability, it compiles to PTX for the highest lower capability that it knows.
    pub(super) fn image<T: Real>(
        &self,
        name: &str,
        functions: &[Function],
        capability: (u32, u32),
    ) -> Result<Vec<u8>, Error> {
        let wanted = (10 * capability.0 + capability.1) as c_int;
        let known = self.architectures();
        let architecture = match known.iter().filter(|&&a| a <= wanted).max() {
            Some(&a) if a != wanted => format!("compute_{a}"),
            _ => format!("sm_{wanted}"), // for an unknown architecture, the compiler reports an error
        };
        self.compile(name, &text::<T>(name, functions), &architecture)
    }

    /// Returns the compute capabilities that the compiler knows, as 10 · major + minor.
    fn architectures(&self) -> Vec<c_int> {
        let mut count = 0;
        // SAFETY: the function writes one number to `count`.
        unsafe { (self.table.nvrtcGetNumSupportedArchs)(&raw mut count) };
        let mut all = vec![0; usize::try_from(count).unwrap_or(0)];
        // SAFETY: the function writes `count` entries, and `all` has `count` entries.
        unsafe { (self.table.nvrtcGetSupportedArchs)(all.as_mut_ptr()) };
        all
    }

    fn compile(&self, name: &str, text: &CStr, architecture: &str) -> Result<Vec<u8>, Error> {
        let failed = |log: String| Error::Compile { name: name.to_owned(), architecture: architecture.to_owned(), log };
        let file = CString::new(format!("{name}.cu")).expect("an identifier has no zeros");
        let mut open = Open(&self.table, null_mut());
        // SAFETY: the strings end with 0, and the number of headers is 0.
        let status = unsafe {
            (self.table.nvrtcCreateProgram)(&raw mut open.1, text.as_ptr(), file.as_ptr(), 0, null(), null())
        };
        if status != 0 {
            return Err(failed(format!("nvrtcCreateProgram: status {status}")));
        }
        let option = CString::new(format!("--gpu-architecture={architecture}")).expect("a number has no zeros");
        // SAFETY: the number of options is 1.
        let status = unsafe { (self.table.nvrtcCompileProgram)(open.1, 1, [option.as_ptr()].as_ptr()) };
        let table = &self.table;
        if status != 0 {
            // SAFETY: `nvrtcGetProgramLog` writes as many bytes as `nvrtcGetProgramLogSize` returns.
            let log = unsafe { open.bytes(table.nvrtcGetProgramLogSize, table.nvrtcGetProgramLog) };
            let log = String::from_utf8_lossy(&log);
            return Err(failed(format!("status {status}: {}", log.trim_end_matches('\0').trim())));
        }
        let image = if architecture.starts_with("sm_") {
            // SAFETY: `nvrtcGetCUBIN` writes as many bytes as `nvrtcGetCUBINSize` returns.
            unsafe { open.bytes(table.nvrtcGetCUBINSize, table.nvrtcGetCUBIN) }
        } else {
            // SAFETY: `nvrtcGetPTX` writes as many bytes as `nvrtcGetPTXSize` returns.
            unsafe { open.bytes(table.nvrtcGetPTXSize, table.nvrtcGetPTX) }
        };
        if image.is_empty() { Err(failed("nothing was made".to_owned())) } else { Ok(image) }
    }
}

/// Returns the CUDA code of the functions.
fn text<T: Real>(name: &str, functions: &[Function]) -> CString {
    let mut files = T::LANGUAGE.text(name, functions);
    CString::new(files.remove(0).text).expect("code has no zeros")
}
