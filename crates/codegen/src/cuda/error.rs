//! Errors of computations on a GPU.

/// Error of a computation on a GPU.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A library of NVIDIA is missing or invalid.
    #[error("{library}: cannot be loaded: {reason}; the environment variable {variable} may name its file")]
    Library {
        /// Name of the library.
        library: &'static str,
        /// The system's message for each file that was tried.
        reason: String,
        /// Environment variable that may name another file of the library.
        variable: &'static str,
    },
    /// The device does not exist.
    #[error("no CUDA device {ordinal}: found {count} device(s)")]
    Device {
        /// The requested ordinal.
        ordinal: usize,
        /// Number of devices.
        count: usize,
    },
    /// A function of CUDA failed.
    #[error("{function}: {text} (status {status})")]
    Call {
        /// Name of the function.
        function: &'static str,
        /// The returned status.
        status: i32,
        /// Name of the status, and CUDA's message.
        text: String,
    },
    /// The compiler rejected the code.
    #[error("{name}: not compiled for {architecture}: {log}")]
    Compile {
        /// Name of the generated code.
        name: String,
        /// Target architecture.
        architecture: String,
        /// The compiler's log.
        log: String,
    },
    /// The driver rejected the compiled code.
    #[error("{name}: not loaded: {text}: {log}")]
    Load {
        /// Name of the generated code.
        name: String,
        /// CUDA's message.
        text: String,
        /// Log of the driver's assembler.
        log: String,
    },
    /// No kernel has this name.
    #[error("no kernel `{name}`; there are {}", known.join(", "))]
    Kernel {
        /// The given name.
        name: String,
        /// Names of the existing kernels.
        known: Vec<String>,
    },
    /// A call has too few or too many arrays.
    #[error("{kernel}: expected {expected} {arrays}, found {found}")]
    Arrays {
        /// Name of the kernel.
        kernel: String,
        /// Arrays whose count is wrong: `inputs` or `outputs`.
        arrays: &'static str,
        /// Number of arrays that the kernel has.
        expected: usize,
        /// Number of arrays that were given.
        found: usize,
    },
    /// An array does not have the required length.
    #[error("{array}: expected {expected} numbers, found {found}")]
    Length {
        /// Name of the array.
        array: String,
        /// Required length.
        expected: usize,
        /// Length of the array.
        found: usize,
    },
    /// The number of states exceeds the kernel's limit.
    #[error("{kernel}: expected at most {most} states, found {found}")]
    States {
        /// Name of the kernel.
        kernel: String,
        /// Maximum number of states. It is limited because indices in the largest array have 32 bits.
        most: usize,
        /// Number of states.
        found: usize,
    },
    /// An array or a stream belongs to another device.
    #[error("{name}: expected one of device {expected}, found one of device {found}")]
    OtherDevice {
        /// Name of the array, or `stream`.
        name: String,
        /// Ordinal of the kernel's device.
        expected: usize,
        /// Ordinal of the array's or stream's device.
        found: usize,
    },
}
