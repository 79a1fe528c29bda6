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
//! Building a program that uses this module needs nothing of CUDA. At run time, [`Driver::new`] loads the driver's
//! library, and [`Compiler::new`] loads NVIDIA's run-time compiler (NVRTC). Both search the system's path, or take the
//! files named by the environment variables `CONDYLE_CUDA_LIBRARY` and `CONDYLE_NVRTC_LIBRARY`. Without NVRTC,
//! [`Device::load`] takes PTX that [`Compiler::ptx`] made elsewhere; making PTX needs no GPU.
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
