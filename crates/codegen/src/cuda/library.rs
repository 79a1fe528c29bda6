//! Shared libraries that are loaded at run time.

use super::error::Error;
use core::error::Error as _;
use libloading::Library;
use std::ffi::OsString;
use std::path::Path;

/// Name of a library, and the names of files that may contain the library.
pub(super) struct Named {
    pub(super) library: &'static str,
    pub(super) variable: &'static str,
    pub(super) files: &'static [&'static str],
}

impl Named {
    /// Loads the library from the given file. Without a file, loads the library from the file named by the environment
    /// variable. Without this variable, searches the system's path.
    pub(super) fn load(&self, file: Option<&Path>) -> Result<Library, Error> {
        let given = file.map(|file| file.as_os_str().to_owned()).or_else(|| std::env::var_os(self.variable));
        let files = match given {
            Some(file) => vec![file],
            None => self.files.iter().map(OsString::from).collect(),
        };
        let mut reasons = Vec::new();
        for file in files {
            // SAFETY: the library's initialisation code comes from NVIDIA, or from a source that the caller trusts.
            match unsafe { Library::new(&file) } {
                Ok(library) => return Ok(library),
                Err(error) => reasons.push(said(&error)),
            }
        }
        Err(self.failed(reasons.join("; ")))
    }

    pub(super) fn failed(&self, reason: String) -> Error {
        Error::Library { library: self.library, reason, variable: self.variable }
    }
}

/// Returns the system's message about a failed load.
pub(super) fn said(error: &libloading::Error) -> String {
    error.source().map_or_else(|| error.to_string(), ToString::to_string)
}

/// Defines a struct of a library's functions, with a constructor that finds the functions by name.
///
/// The library stays loaded until the process ends.
macro_rules! library_functions {
    ($table:ident: $($function:ident($($argument:ty),*);)*) => {
        #[allow(non_snake_case)]
        pub(super) struct $table {
            $(pub(super) $function: unsafe extern "system" fn($($argument),*) -> core::ffi::c_int,)*
        }

        impl $table {
            pub(super) fn load(
                named: &$crate::cuda::library::Named,
                file: Option<&std::path::Path>,
            ) -> Result<Self, $crate::cuda::Error> {
                let library = named.load(file)?;
                let table = Self {
                    $($function: {
                        // SAFETY: the declared type equals the function's type in NVIDIA's header.
                        let found = unsafe { library.get(concat!(stringify!($function), "\0").as_bytes()) };
                        *found.map_err(|error| named.failed($crate::cuda::library::said(&error)))?
                    },)*
                };
                core::mem::forget(library);
                Ok(table)
            }
        }
    };
}
pub(super) use library_functions;
