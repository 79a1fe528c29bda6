//! Reads and makes DLPack capsules for the module `condyle.cuda`. With these capsules, libraries lend each other arrays
//! on devices.
//!
//! The borrower may return a lent array from any thread, also after the interpreter has ended.
#![allow(unsafe_code)]

use core::ffi::{CStr, c_void};
use core::ptr::null_mut;
use pyo3::exceptions::{PyBufferError, PyTypeError};
use pyo3::ffi;
use pyo3::prelude::*;

/// The structures and constants of DLPack's header.
#[repr(C)]
struct Tensor {
    data: *mut c_void,
    device: (i32, i32),
    ndim: i32,
    dtype: (u8, u8, u16),
    shape: *mut i64,
    strides: *mut i64,
    byte_offset: u64,
}

#[repr(C)]
struct Managed {
    tensor: Tensor,
    context: *mut c_void,
    deleter: Option<unsafe extern "C" fn(*mut Managed)>,
}

#[repr(C)]
struct Versioned {
    version: (u32, u32),
    context: *mut c_void,
    deleter: Option<unsafe extern "C" fn(*mut Versioned)>,
    flags: u64,
    tensor: Tensor,
}

const CUDA: i32 = 2;
const FLOAT: u8 = 2;
const VERSION: (u32, u32) = (1, 0);
const PLAIN: &CStr = c"dltensor";
const VERSIONED: &CStr = c"dltensor_versioned";

/// The contents of a capsule: address, (kind of number, bits, lanes), shape, strides in numbers (`None`: C order),
/// (kind of device, device index), flags.
type Description = (usize, (u8, u8, u16), Vec<i64>, Option<Vec<i64>>, (i32, i32), u64);

/// Describes the array that a DLPack capsule lends. The caller must keep the capsule alive while it uses the array.
/// This function does not take ownership of the array.
#[pyfunction]
#[pyo3(name = "_borrowed")]
pub(crate) fn borrowed(capsule: &Bound<'_, PyAny>) -> PyResult<Description> {
    // SAFETY: the capsule's name determines its structure. In other major versions, fields up to `flags` are the same.
    let (tensor, flags) = unsafe {
        if ffi::PyCapsule_IsValid(capsule.as_ptr(), VERSIONED.as_ptr()) != 0 {
            let managed = ffi::PyCapsule_GetPointer(capsule.as_ptr(), VERSIONED.as_ptr()).cast::<Versioned>();
            let (major, _) = (*managed).version;
            if major != VERSION.0 {
                return Err(PyBufferError::new_err(format!("DLPack: expected version {}, found {major}", VERSION.0)));
            }
            (&raw const (*managed).tensor, (*managed).flags)
        } else if ffi::PyCapsule_IsValid(capsule.as_ptr(), PLAIN.as_ptr()) != 0 {
            let managed = ffi::PyCapsule_GetPointer(capsule.as_ptr(), PLAIN.as_ptr()).cast::<Managed>();
            (&raw const (*managed).tensor, 0)
        } else {
            return Err(PyTypeError::new_err("DLPack: expected a capsule that nobody has taken over"));
        }
    };
    // SAFETY: the capsule's name determines its structure. The structure has `ndim` sizes and as many strides, or null
    // strides.
    unsafe {
        let tensor = &*tensor;
        let numbers = |from: *mut i64| match usize::try_from(tensor.ndim) {
            Ok(ndim) if ndim > 0 && !from.is_null() => core::slice::from_raw_parts(from, ndim).to_vec(),
            _ => Vec::new(),
        };
        let strides = (!tensor.strides.is_null()).then(|| numbers(tensor.strides));
        let address = tensor.data as usize + tensor.byte_offset as usize;
        Ok((address, tensor.dtype, numbers(tensor.shape), strides, tensor.device, flags))
    }
}

/// A lent array: its description of type `M`, and all data to which the description points.
struct Lent<M> {
    managed: M,
    _numbers: [Vec<i64>; 2],
    owner: Option<Py<PyAny>>,
}

/// Takes back a lent array.
///
/// # Safety
/// `context` comes from a `Box<Lent<M>>`, and the caller does not use `context` afterwards.
unsafe fn take_back<M>(context: *mut c_void) {
    // SAFETY: the caller promises that `context` comes from a `Box<Lent<M>>`.
    let mut lent = unsafe { Box::from_raw(context.cast::<Lent<M>>()) };
    let mut owner = lent.owner.take();
    if Python::try_attach(|_| drop(owner.take())).is_none() {
        core::mem::forget(owner); // the interpreter has ended, so the owner cannot be released
    }
}

unsafe extern "C" fn delete_plain(managed: *mut Managed) {
    // SAFETY: the borrower calls this function once.
    unsafe { take_back::<Managed>((*managed).context) }
}

unsafe extern "C" fn delete_versioned(managed: *mut Versioned) {
    // SAFETY: the borrower calls this function once.
    unsafe { take_back::<Versioned>((*managed).context) }
}

/// Destroys a capsule. A library that takes over the array renames the capsule. If the name is unchanged, no library
/// took over the array, and the array is taken back.
unsafe extern "C" fn end(capsule: *mut ffi::PyObject) {
    // SAFETY: capsules with this destructor and an unchanged name hold the structure that `lend` stored.
    unsafe {
        if ffi::PyCapsule_IsValid(capsule, VERSIONED.as_ptr()) != 0 {
            delete_versioned(ffi::PyCapsule_GetPointer(capsule, VERSIONED.as_ptr()).cast());
        } else if ffi::PyCapsule_IsValid(capsule, PLAIN.as_ptr()) != 0 {
            delete_plain(ffi::PyCapsule_GetPointer(capsule, PLAIN.as_ptr()).cast());
        }
    }
}

/// Makes a DLPack capsule that lends floating-point numbers on a CUDA device. The owner of the numbers is kept alive
/// until the borrower returns them.
#[pyfunction]
#[pyo3(name = "_lend")]
pub(crate) fn lend(
    py: Python<'_>,
    owner: Py<PyAny>,
    address: usize,
    bits: u8,
    shape: Vec<i64>,
    strides: Vec<i64>,
    device: i32,
    versioned: bool,
) -> PyResult<Py<PyAny>> {
    let (ndim, owner) = (shape.len() as i32, Some(owner));
    let mut _numbers = [shape, strides]; // the numbers keep their addresses when the vectors are moved
    let [shape, strides] = _numbers.each_mut().map(Vec::as_mut_ptr);
    let (data, dtype, context) = (address as *mut c_void, (FLOAT, bits, 1), null_mut());
    let tensor = Tensor { data, device: (CUDA, device), ndim, dtype, shape, strides, byte_offset: 0 };
    let (managed, name): (*mut c_void, _) = if versioned {
        let managed = Versioned { version: VERSION, context, deleter: Some(delete_versioned), flags: 0, tensor };
        let lent = Box::into_raw(Box::new(Lent { managed, _numbers, owner }));
        // SAFETY: the pointer comes from `Box::into_raw`, and no other code uses it yet.
        unsafe { (*lent).managed.context = lent.cast() };
        // SAFETY: the pointer comes from `Box::into_raw`.
        (unsafe { &raw mut (*lent).managed }.cast(), VERSIONED)
    } else {
        let managed = Managed { tensor, context, deleter: Some(delete_plain) };
        let lent = Box::into_raw(Box::new(Lent { managed, _numbers, owner }));
        // SAFETY: the pointer comes from `Box::into_raw`, and no other code uses it yet.
        unsafe { (*lent).managed.context = lent.cast() };
        // SAFETY: the pointer comes from `Box::into_raw`.
        (unsafe { &raw mut (*lent).managed }.cast(), PLAIN)
    };
    // SAFETY: the name is a constant; `end` takes back the lent array.
    unsafe { Bound::from_owned_ptr_or_err(py, ffi::PyCapsule_New(managed, name.as_ptr(), Some(end))) }
        .map(Bound::unbind)
}
