//! Devices and their streams.

use super::driver::{Driver, Handle, call};
use super::error::Error;
use core::ffi::{CStr, c_char, c_int};
use core::fmt;
use core::ptr::null_mut;
use std::sync::Arc;

/// Identifiers of a device's attributes, from CUDA's header.
const MULTIPROCESSORS: c_int = 16;
const CAPABILITY_MAJOR: c_int = 75;
const CAPABILITY_MINOR: c_int = 76;

/// Flag of a stream that does not wait for the legacy default stream.
const NON_BLOCKING: u32 = 1;

/// Flag of an event without timing.
const DISABLE_TIMING: u32 = 2;

/// Handle of a GPU and of the GPU's primary context. The context exists as long as this handle or any object of the
/// device exists.
///
/// Clones of the handle refer to the same device. Several threads may use the handle at the same time.
#[derive(Clone)]
pub struct Device(pub(super) Arc<Inner>);

pub(super) struct Inner {
    pub(super) driver: Driver,
    pub(super) ordinal: usize,
    device: c_int,
    context: Handle,
    pub(super) multiprocessors: usize,
    capability: (u32, u32),
}

// SAFETY: any thread may make a context current, also several threads at the same time.
unsafe impl Send for Inner {}
// SAFETY: any thread may make a context current, also several threads at the same time.
unsafe impl Sync for Inner {}

impl Drop for Inner {
    fn drop(&mut self) {
        let _ = call!(self.driver, cuDevicePrimaryCtxRelease_v2(self.device));
    }
}

/// Guard that makes a device's context current on the present thread while the guard exists.
pub(super) struct Current<'a>(&'a Inner);

impl Drop for Current<'_> {
    fn drop(&mut self) {
        let _ = call!(self.0.driver, cuCtxPopCurrent_v2(null_mut()));
    }
}

impl Inner {
    pub(super) fn current(&self) -> Result<Current<'_>, Error> {
        call!(self.driver, cuCtxPushCurrent_v2(self.context))?;
        Ok(Current(self))
    }
}

impl Driver {
    /// Returns the device with this ordinal.
    ///
    /// # Errors
    /// [`Error::Device`] if the device does not exist; [`Error::Call`].
    pub fn device(&self, ordinal: usize) -> Result<Device, Error> {
        Device::open(self.clone(), ordinal)
    }
}

impl fmt::Debug for Device {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Device").field(&self.0.ordinal).finish()
    }
}

impl PartialEq for Device {
    /// Returns whether both handles refer to the same GPU.
    fn eq(&self, other: &Self) -> bool {
        self.0.context == other.0.context
    }
}

impl Device {
    /// Returns the device with this ordinal, using the driver found by [`Driver::new`].
    ///
    /// # Errors
    /// The errors of [`Driver::new`] and [`Driver::device`].
    pub fn new(ordinal: usize) -> Result<Self, Error> {
        Driver::new()?.device(ordinal)
    }

    fn open(driver: Driver, ordinal: usize) -> Result<Self, Error> {
        let count = driver.devices()?;
        if ordinal >= count {
            return Err(Error::Device { ordinal, count });
        }
        let (mut device, mut context) = (0, null_mut());
        call!(driver, cuDeviceGet(&raw mut device, ordinal as c_int))?;
        let attribute = |attribute| {
            let mut value = 0;
            call!(driver, cuDeviceGetAttribute(&raw mut value, attribute, device))?;
            Ok::<_, Error>(value.unsigned_abs())
        };
        let multiprocessors = attribute(MULTIPROCESSORS)?.max(1) as usize;
        let capability = (attribute(CAPABILITY_MAJOR)?, attribute(CAPABILITY_MINOR)?);
        call!(driver, cuDevicePrimaryCtxRetain(&raw mut context, device))?;
        Ok(Self(Arc::new(Inner { driver, ordinal, device, context, multiprocessors, capability })))
    }

    /// Returns the ordinal with which the caller requested the device.
    pub fn ordinal(&self) -> usize {
        self.0.ordinal
    }

    /// Returns the compute capability, for example (9, 0) for Hopper.
    pub fn capability(&self) -> (u32, u32) {
        self.0.capability
    }

    /// Returns the product name.
    ///
    /// # Errors
    /// [`Error::Call`].
    pub fn name(&self) -> Result<String, Error> {
        let mut name: [c_char; 256] = [0; 256];
        call!(self.0.driver, cuDeviceGetName(name.as_mut_ptr(), 255, self.0.device))?;
        // SAFETY: the last character of the buffer stays 0.
        Ok(unsafe { CStr::from_ptr(name.as_ptr()) }.to_string_lossy().into_owned())
    }

    /// Creates a stream. Only [`Stream::wait_for`] orders it with other streams.
    ///
    /// # Errors
    /// [`Error::Call`].
    pub fn stream(&self) -> Result<Stream, Error> {
        let (mut handle, _current) = (null_mut(), self.0.current()?);
        call!(self.0.driver, cuStreamCreate(&raw mut handle, NON_BLOCKING))?;
        Ok(Stream { device: self.clone(), handle, is_owned: true })
    }

    /// Returns the legacy default stream. The default stream is ordered with all streams of other libraries, except
    /// streams that were created as non-blocking.
    pub fn default_stream(&self) -> Stream {
        Stream { device: self.clone(), handle: null_mut(), is_owned: false }
    }
}

/// A queue of work. Copies and kernels in the same stream run one after the other.
///
/// Each copy and each kernel call takes a stream as an argument. Several threads may use a stream at the same time.
pub struct Stream {
    pub(super) device: Device,
    pub(super) handle: Handle,
    is_owned: bool,
}

// SAFETY: any thread may add work to a stream, also several threads at the same time.
unsafe impl Send for Stream {}
// SAFETY: any thread may add work to a stream, also several threads at the same time.
unsafe impl Sync for Stream {}

impl fmt::Debug for Stream {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Stream").field("device", &self.device).field("handle", &self.handle).finish()
    }
}

impl Drop for Stream {
    fn drop(&mut self) {
        if let (true, Ok(_current)) = (self.is_owned, self.device.0.current()) {
            let _ = call!(self.device.0.driver, cuStreamDestroy_v2(self.handle)); // work in progress still finishes
        }
    }
}

impl Stream {
    /// Makes an object for a stream of another library, given as `CUstream` or `cudaStream_t`. Dropping the object does
    /// not destroy the stream.
    ///
    /// # Safety
    /// The stream must belong to the device's primary context and outlive this object.
    pub unsafe fn from_raw(device: &Device, handle: u64) -> Self {
        Self { device: device.clone(), handle: handle as Handle, is_owned: false }
    }

    /// Returns the stream's `CUstream`, for other libraries.
    pub fn as_raw(&self) -> u64 {
        self.handle as u64
    }

    /// Makes all later work of this stream wait for all work that is already in the other stream.
    ///
    /// # Errors
    /// [`Error::Call`].
    pub fn wait_for(&self, other: &Self) -> Result<(), Error> {
        let driver = &self.device.0.driver;
        let mut event = null_mut();
        let made = {
            let _current = other.device.0.current()?;
            call!(driver, cuEventCreate(&raw mut event, DISABLE_TIMING))?;
            call!(driver, cuEventRecord(event, other.handle))
        };
        let _current = self.device.0.current()?;
        let waits = made.and_then(|()| call!(driver, cuStreamWaitEvent(self.handle, event, 0)));
        call!(driver, cuEventDestroy_v2(event))?; // the driver destroys the event after it has occurred
        waits
    }

    /// Waits until all work in the stream is done.
    ///
    /// # Errors
    /// [`Error::Call`], also for failures of earlier kernels.
    pub fn synchronize(&self) -> Result<(), Error> {
        let _current = self.device.0.current()?;
        call!(self.device.0.driver, cuStreamSynchronize(self.handle))
    }
}
