//! Why nothing was computed on a GPU.

/// Why nothing was computed on a GPU.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A library of NVIDIA's is not there, or is none.
    #[error("{library}: cannot be loaded: {reason}; the environment variable {variable} may name its file")]
    Library {
        /// Which one.
        library: &'static str,
        /// What the system says of each file that was tried.
        reason: String,
        /// The environment variable that names another file.
        variable: &'static str,
    },
    /// There is no such device.
    #[error("device {ordinal}: there are {count}")]
    Device {
        /// The number that was asked for.
        ordinal: usize,
        /// How many there are.
        count: usize,
    },
    /// A function of CUDA's failed.
    #[error("{function}: {text} (status {status})")]
    Call {
        /// The function.
        function: &'static str,
        /// What it returned.
        status: i32,
        /// Its name and CUDA's words for it.
        text: String,
    },
    /// The compiler refused the code.
    #[error("{name}: not compiled for {architecture}: {log}")]
    Compile {
        /// The name of the code.
        name: String,
        /// For which devices.
        architecture: String,
        /// What the compiler says.
        log: String,
    },
    /// The driver refused what was compiled.
    #[error("{name}: not loaded: {text}: {log}")]
    Load {
        /// The name of the code.
        name: String,
        /// CUDA's words for it.
        text: String,
        /// What the driver's assembler says.
        log: String,
    },
    /// There is no kernel of that name.
    #[error("no kernel `{name}`; there are {}", known.join(", "))]
    Kernel {
        /// The name that was given.
        name: String,
        /// Those that there are.
        known: Vec<String>,
    },
    /// There are too few or too many arrays.
    #[error("{kernel}: expected {expected} {arrays}, found {found}")]
    Arrays {
        /// The kernel.
        kernel: String,
        /// `inputs` or `outputs`.
        arrays: &'static str,
        /// How many it has.
        expected: usize,
        /// How many were given.
        found: usize,
    },
    /// An array has not the length that it should have.
    #[error("{array}: expected {expected} numbers, found {found}")]
    Length {
        /// Its name.
        array: String,
        /// How many numbers it should have.
        expected: usize,
        /// How many it has.
        found: usize,
    },
    /// There are more states than a kernel can count.
    #[error("{kernel}: expected at most {most} states, found {found}")]
    States {
        /// The kernel.
        kernel: String,
        /// How many there may be: the places in the largest array are numbers of 32 bits.
        most: usize,
        /// How many there are.
        found: usize,
    },
    /// An array or a stream belongs to another device.
    #[error("{name}: expected one of device {expected}, found one of device {found}")]
    OtherDevice {
        /// The array's name, or `stream`.
        name: String,
        /// The device of the kernel.
        expected: usize,
        /// The device where it is.
        found: usize,
    },
}
