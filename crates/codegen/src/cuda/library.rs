//! Libraries that are loaded while the program runs.

use super::error::Error;
use core::error::Error as _;
use libloading::Library;
use std::ffi::OsString;
use std::path::Path;

/// A library: how it is called, and where it may be.
pub(super) struct Named {
    pub(super) library: &'static str,
    pub(super) variable: &'static str,
    pub(super) files: &'static [&'static str],
}

impl Named {
    /// The library in the file that was given, else in that which the environment variable names, else where the system finds it.
    pub(super) fn load(&self, file: Option<&Path>) -> Result<Library, Error> {
        let given = file.map(|file| file.as_os_str().to_owned()).or_else(|| std::env::var_os(self.variable));
        let files = match given {
            Some(file) => vec![file],
            None => self.files.iter().map(OsString::from).collect(),
        };
        let mut reasons = Vec::new();
        for file in files {
            // SAFETY: what it runs when it is loaded is NVIDIA's, or of whom the caller trusts.
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

/// What the system says.
pub(super) fn said(error: &libloading::Error) -> String {
    error.source().map_or_else(|| error.to_string(), ToString::to_string)
}

/// Defines a struct with a library's functions, and how they are found there by their names.
///
/// The library stays loaded until the process ends.
macro_rules! library_functions {
    ($table:ident: $($function:ident($($argument:ty),*);)*) => {
        #[allow(non_snake_case)]
        pub(super) struct $table {
            $(pub(super) $function: unsafe extern "system" fn($($argument),*) -> core::ffi::c_int,)*
        }

        impl $table {
            pub(super) fn load(named: &$crate::cuda::library::Named, file: Option<&std::path::Path>) -> Result<Self, $crate::cuda::Error> {
                let library = named.load(file)?;
                let table = Self {
                    $($function: {
                        // SAFETY: this is the function's type in NVIDIA's header.
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
