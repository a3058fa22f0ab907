//! Pointers of the caller.

use crate::call::{Failure, Outcome};
use std::ffi::{CStr, c_char};
use std::mem::MaybeUninit;
use std::path::PathBuf;

/// Largest `struct_size` that a newer header may have.
const LARGEST_STRUCT: usize = 4096;

/// A struct of isv.h that begins with `struct_size`.
///
/// # Safety
/// It is `repr(C)`, its first member is a `usize`, and all bits 0 are a value of it. Its members are numbers and pointers, which may
/// have any bits.
pub(crate) unsafe trait SizedStruct: Sized {
    /// Name in isv.h.
    const NAME: &'static str;
    /// Size in the first version of the library that had it. It stays when members are added at the end.
    const LEAST: usize;
}

/// Borrows an array of the caller's.
///
/// # Safety
/// If it is neither null nor misaligned, the pointer is good for `count` elements for as long as the slice is used.
pub(crate) unsafe fn slice<'a, T>(name: &str, pointer: *const T, count: usize) -> Outcome<&'a [T]> {
    if count == 0 {
        return Ok(&[]);
    }
    check_pointer(name, pointer)?;
    if count.checked_mul(size_of::<T>()).is_none_or(|bytes| bytes > isize::MAX as usize) {
        return Err(Failure::argument(format!("{name} has {count} elements: no memory holds as many")));
    }
    // SAFETY: the pointer is aligned and not null, and the caller vouches for the rest.
    Ok(unsafe { std::slice::from_raw_parts(pointer, count) })
}

/// Borrows an array of the caller's that may be left out: a null pointer is an empty one.
///
/// # Safety
/// See [`slice`].
pub(crate) unsafe fn optional_slice<'a, T>(name: &str, pointer: *const T, count: usize) -> Outcome<&'a [T]> {
    if pointer.is_null() {
        return Ok(&[]);
    }
    // SAFETY: the caller vouches for it.
    unsafe { slice(name, pointer, count) }
}

/// Borrows text of the caller's.
///
/// # Safety
/// If it is not null, the pointer is good up to a 0 for as long as the text is used.
pub(crate) unsafe fn text<'a>(name: &str, pointer: *const c_char) -> Outcome<&'a str> {
    check_pointer(name, pointer)?;
    // SAFETY: the pointer is not null, and the caller vouches for the rest.
    let text = unsafe { CStr::from_ptr(pointer) };
    text.to_str().map_err(|_| Failure::argument(format!("{name} is not UTF-8")))
}

/// Reads a path of the caller's.
///
/// # Safety
/// See [`text`].
pub(crate) unsafe fn path(name: &str, pointer: *const c_char) -> Outcome<PathBuf> {
    // SAFETY: the caller vouches for it.
    match unsafe { text(name, pointer) }? {
        "" => Err(Failure::argument(format!("{name} is empty"))),
        path => Ok(PathBuf::from(path)),
    }
}

/// Borrows a place of the caller's for a result.
///
/// # Safety
/// If it is neither null nor misaligned, the pointer is good for writing a value for as long as the place is used.
pub(crate) unsafe fn place<'a, T>(name: &str, pointer: *mut T) -> Outcome<&'a mut MaybeUninit<T>> {
    check_pointer(name, pointer)?;
    // SAFETY: the pointer is aligned and not null, and the caller vouches for the rest.
    Ok(unsafe { &mut *pointer.cast() })
}

/// Reads a struct of the caller's, from an older, this or a newer header.
///
/// # Safety
/// If it is neither null nor misaligned, the pointer is good for as many bytes as `struct_size` says.
pub(crate) unsafe fn read<T: SizedStruct>(pointer: *const T) -> Outcome<T> {
    // SAFETY: the caller vouches for it.
    let size = unsafe { stated_size(pointer) }?;
    let (bytes, own) = (pointer.cast::<u8>(), size.min(size_of::<T>()));
    // SAFETY: the struct has `size` bytes, which are numbers.
    let newer = unsafe { std::slice::from_raw_parts(bytes.add(own), size - own) };
    if newer.iter().any(|byte| *byte != 0) {
        let name = T::NAME;
        return Err(Failure::argument(format!(
            "{name} has members that this version of the library does not know"
        )));
    }
    let mut value = MaybeUninit::<T>::zeroed();
    // SAFETY: both have `own` bytes, and all bits 0 are a value, as are any numbers and pointers.
    unsafe {
        std::ptr::copy_nonoverlapping(bytes, value.as_mut_ptr().cast(), own);
        Ok(value.assume_init())
    }
}

/// Writes a struct of the caller's, up to the size that it states. Members of newer headers become 0, and `struct_size` stays.
///
/// # Safety
/// If it is neither null nor misaligned, the pointer is good for as many bytes as `struct_size` says.
pub(crate) unsafe fn write<T: SizedStruct>(pointer: *mut T, value: &T) -> Outcome {
    // SAFETY: the caller vouches for it.
    let size = unsafe { stated_size(pointer) }?;
    let (own, first) = (size.min(size_of::<T>()), size_of::<usize>());
    let (bytes, from) = (pointer.cast::<u8>(), std::ptr::from_ref(value).cast::<u8>());
    // SAFETY: the caller's struct has `size` bytes, `value` at least `own`, and they are two structs.
    unsafe {
        std::ptr::copy_nonoverlapping(from.add(first), bytes.add(first), own - first);
        std::ptr::write_bytes(bytes.add(own), 0, size - own);
    }
    Ok(())
}

/// Checks that a struct of the caller's can be read or written.
///
/// # Safety
/// See [`read`].
pub(crate) unsafe fn stated_size<T: SizedStruct>(pointer: *const T) -> Outcome<usize> {
    let (name, least, own) = (T::NAME, T::LEAST, size_of::<T>());
    check_pointer(name, pointer)?;
    // SAFETY: the pointer is aligned and not null, and the first member is a number.
    let size = unsafe { *pointer.cast::<usize>() };
    match size {
        _ if size < least => Err(Failure::argument(format!(
            "{name}.struct_size is {size}, not {own}: set it to sizeof({name})"
        ))),
        _ if size > LARGEST_STRUCT => {
            Err(Failure::argument(format!("{name}.struct_size is {size}: no {name} is that large")))
        }
        _ => Ok(size),
    }
}

fn check_pointer<T>(name: &str, pointer: *const T) -> Outcome {
    match pointer {
        _ if pointer.is_null() => Err(Failure::argument(format!("{name} is null"))),
        _ if !pointer.is_aligned() => Err(Failure::argument(format!(
            "{name} is at {pointer:?}, which is not a multiple of {}",
            align_of::<T>()
        ))),
        _ => Ok(()),
    }
}
