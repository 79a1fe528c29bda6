//! Generated kernels on a GPU. They are compiled at run time, and called with arrays on the device.
//!
//! ```no_run
//! use condyle_codegen::cuda::{Compiler, Device, DeviceArray};
//! use condyle_codegen::{Settings, functions};
//! let arm = condyle_dynamics::robots::arm7();
//! let device = Device::new(0)?;
//! let aba = functions(&arm, &["aba"], &Settings::default()).unwrap();
//! let kernels = device.compile::<f64>(&Compiler::new()?, "arm7", &aba)?;
//!
//! let n = 100_000;                                      // states: number k of state i stands at [k * n + i]
//! let stream = device.stream()?;
//! let q = DeviceArray::from_slice(&stream, &vec![0.3; 7 * n])?;
//! let v = DeviceArray::from_slice(&stream, &vec![0.1; 7 * n])?;
//! let tau = DeviceArray::from_slice(&stream, &vec![1.0; 7 * n])?;
//! let mut a = DeviceArray::new(&device, 7 * n)?;
//! kernels.kernel("aba")?.call(&stream, n, &[&q, &v, &tau], &mut [&mut a])?; // returns at once
//! println!("{}", a.to_vec(&stream)?[0]);
//! # Ok::<(), condyle_codegen::cuda::Error>(())
//! ```
//!
//! A program that uses this module can be built without CUDA. At run time, [`Driver::new`] loads the driver's library,
//! and [`Compiler::new`] loads NVIDIA's run-time compiler (NVRTC). Each library is searched in the system's path, or
//! loaded from a file named by an environment variable: `CONDYLE_CUDA_LIBRARY` or `CONDYLE_NVRTC_LIBRARY`. On a machine
//! without NVRTC, [`Device::load`] loads PTX code that [`Compiler::ptx`] made on another machine. Making PTX code needs
//! no GPU.
//!
//! All work uses the device's primary context, which other libraries in the process also use. [`DeviceArray::from_raw`]
//! and [`Stream::from_raw`] use arrays and streams of other libraries.
#![allow(unsafe_code)] // calls functions of two libraries in C

mod array;
mod compiler;
mod device;
mod driver;
mod error;
mod kernels;
mod library;

pub use array::{DeviceArray, Real};
pub use compiler::Compiler;
pub use device::{Device, Stream};
pub use driver::Driver;
pub use error::Error;
pub use kernels::{Kernel, Kernels};
