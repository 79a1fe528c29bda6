//! Arrays in the memory of a device.

use super::device::{Device, Stream};
use super::driver::{Address, call};
use super::error::Error;
use crate::text::Language;
use core::fmt;
use core::marker::PhantomData;

/// Number type of kernels: `f64` or `f32`.
pub trait Real: Copy + Default + sealed::Sealed + 'static {
    /// Language in which kernels for this number type are written.
    const LANGUAGE: Language;
}

impl Real for f64 {
    const LANGUAGE: Language = Language::Cuda;
}

impl Real for f32 {
    const LANGUAGE: Language = Language::CudaFloat;
}

mod sealed {
    pub trait Sealed {}
    impl Sealed for f64 {}
    impl Sealed for f32 {}
}

/// Array of numbers in the memory of a device. It contains the numbers of n states. Number k of state i is stored at
/// index `[k * n + i]`.
///
/// Dropping the array frees its memory, after all streams have finished with it.
pub struct DeviceArray<T: Real> {
    pub(super) device: Device,
    pub(super) address: Address,
    len: usize,
    is_owned: bool,
    number: PhantomData<T>,
}

impl<T: Real> fmt::Debug for DeviceArray<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("DeviceArray").field("device", &self.device).field("len", &self.len).finish_non_exhaustive()
    }
}

impl<T: Real> Drop for DeviceArray<T> {
    fn drop(&mut self) {
        if let (true, Ok(_current)) = (self.is_owned, self.device.0.current()) {
            let _ = call!(self.device.0.driver, cuMemFree_v2(self.address)); // this call waits for all streams
        }
    }
}

impl<T: Real> DeviceArray<T> {
    /// Allocates memory for `len` numbers; their values are undefined.
    ///
    /// # Errors
    /// [`Error::Call`], for example if there is too little memory.
    pub fn new(device: &Device, len: usize) -> Result<Self, Error> {
        let mut address = 0;
        if len > 0 {
            let _current = device.0.current()?;
            call!(device.0.driver, cuMemAlloc_v2(&raw mut address, len.saturating_mul(size_of::<T>())))?;
        }
        Ok(Self { device: device.clone(), address, len, is_owned: len > 0, number: PhantomData })
    }

    /// Copies the numbers into a new array.
    ///
    /// # Errors
    /// [`Error::Call`].
    pub fn from_slice(stream: &Stream, numbers: &[T]) -> Result<Self, Error> {
        let mut array = Self::new(&stream.device, numbers.len())?;
        array.write(stream, numbers)?;
        Ok(array)
    }

    /// Makes an array from memory that another library allocated. The array neither copies nor frees this memory.
    ///
    /// # Safety
    /// `len` numbers of type `T` must be stored at this address of the device, in memory that outlives the array. Any
    /// other stream that reads or writes this memory must be ordered with the streams that use the array.
    pub unsafe fn from_raw(device: &Device, address: u64, len: usize) -> Self {
        Self { device: device.clone(), address, len, is_owned: false, number: PhantomData }
    }

    /// Returns the address in the device's memory, for other libraries.
    pub fn as_raw(&self) -> u64 {
        self.address
    }

    /// Returns the length of the array: the count of its numbers.
    #[allow(clippy::len_without_is_empty)]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Copies numbers to the device, after earlier work of the stream, and waits for the copy.
    ///
    /// # Errors
    /// [`Error::Length`] if `numbers` does not have the array's length; [`Error::OtherDevice`]; [`Error::Call`].
    pub fn write(&mut self, stream: &Stream, numbers: &[T]) -> Result<(), Error> {
        self.check(stream, "numbers", numbers.len())?;
        if self.len == 0 {
            return Ok(());
        }
        let _current = self.device.0.current()?;
        let (driver, from) = (&self.device.0.driver, numbers.as_ptr().cast());
        call!(driver, cuMemcpyHtoDAsync_v2(self.address, from, size_of_val(numbers), stream.handle))?;
        call!(driver, cuStreamSynchronize(stream.handle))
    }

    /// Copies the numbers from the device, after earlier work of the stream, and waits for the copy.
    ///
    /// # Errors
    /// [`Error::Length`] if `numbers` does not have the array's length; [`Error::OtherDevice`]; [`Error::Call`], also
    /// for failures of earlier kernels.
    pub fn read(&self, stream: &Stream, numbers: &mut [T]) -> Result<(), Error> {
        self.check(stream, "numbers", numbers.len())?;
        if self.len == 0 {
            return Ok(());
        }
        let _current = self.device.0.current()?;
        let (driver, to) = (&self.device.0.driver, numbers.as_mut_ptr().cast());
        let copied = call!(driver, cuMemcpyDtoHAsync_v2(to, self.address, size_of_val(numbers), stream.handle));
        call!(driver, cuStreamSynchronize(stream.handle)).and(copied)
    }

    /// Copies the numbers from the device into a new vector, as [`read`](Self::read) does.
    ///
    /// # Errors
    /// The errors of [`read`](Self::read).
    pub fn to_vec(&self, stream: &Stream) -> Result<Vec<T>, Error> {
        let mut numbers = vec![T::default(); self.len];
        self.read(stream, &mut numbers)?;
        Ok(numbers)
    }

    fn check(&self, stream: &Stream, name: &str, len: usize) -> Result<(), Error> {
        if len != self.len {
            return Err(Error::Length { array: name.to_owned(), expected: self.len, found: len });
        }
        on_device("stream", &self.device, &stream.device)
    }
}

/// Checks that an array or a stream belongs to the device on which it is used.
pub(super) fn on_device(name: &str, expected: &Device, found: &Device) -> Result<(), Error> {
    if expected == found {
        return Ok(());
    }
    Err(Error::OtherDevice { name: name.to_owned(), expected: expected.ordinal(), found: found.ordinal() })
}
