//! Handles: numbers that stand for objects.

use crate::call::{Failure, Outcome};
use crate::status::{ISV_ERROR_BUSY, ISV_ERROR_HANDLE, ISV_ERROR_INTERNAL};
use std::any::Any;
use std::collections::{BTreeMap, btree_map::Entry};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock, TryLockError};

/// A type of handle.
pub(crate) trait Handle {
    /// Object that it stands for.
    type Object: Send + Sync + 'static;
    /// Name in isv.h.
    const NAME: &'static str;
}

/// Bits that all handles have. No address has the lowest ones, as objects are aligned; on 64-bit machines no address that a program
/// may use has the highest ones either.
const MARK: usize = (0x15_u64 << 56) as usize | 0b101;
/// Bits of [`MARK`] at the lower end.
const MARK_BITS: u32 = 3;

struct Table {
    objects: BTreeMap<usize, (&'static str, Arc<dyn Any + Send + Sync>)>,
    /// Handles given out so far.
    count: usize,
}

static TABLE: RwLock<Table> = RwLock::new(Table { objects: BTreeMap::new(), count: 0 });

/// Gives an object a handle.
pub(crate) fn add<H: Handle>(object: H::Object) -> *mut H {
    let mut table = TABLE.write().unwrap_or_else(PoisonError::into_inner);
    loop {
        table.count = table.count.wrapping_add(1);
        let number = MARK | table.count << MARK_BITS;
        // On 32-bit machines numbers come again in the end.
        if let Entry::Vacant(place) = table.objects.entry(number) {
            place.insert((H::NAME, Arc::new(object)));
            return std::ptr::without_provenance_mut(number);
        }
    }
}

/// Finds the object of a handle. It stays alive while it is used, though another thread frees the handle.
pub(crate) fn get<H: Handle>(handle: *const H) -> Outcome<Arc<H::Object>> {
    let table = TABLE.read().unwrap_or_else(PoisonError::into_inner);
    let Some((name, object)) = table.objects.get(&handle.addr()) else {
        return Err(table.missing::<H>(handle.addr()));
    };
    Arc::clone(object).downcast().map_err(|_| wrong_type::<H>(name))
}

/// Takes a handle back; null is one that was never there.
pub(crate) fn free<H: Handle>(handle: *mut H) -> Outcome {
    if handle.is_null() {
        return Ok(());
    }
    let mut table = TABLE.write().unwrap_or_else(PoisonError::into_inner);
    let number = handle.addr();
    match table.objects.get(&number) {
        None => Err(table.missing::<H>(number)),
        Some((name, object)) if !object.is::<H::Object>() => Err(wrong_type::<H>(name)),
        Some(_) => {
            let object = table.objects.remove(&number);
            // A callback may be called while it is dropped, which may make calls.
            drop(table);
            drop(object);
            Ok(())
        }
    }
}

/// Locks an object's state for one call.
pub(crate) fn lock<T>(state: &Mutex<T>) -> Outcome<MutexGuard<'_, T>> {
    state.try_lock().map_err(|error| match error {
        TryLockError::WouldBlock => {
            Failure::new(ISV_ERROR_BUSY, "the handle serves another call: a handle serves one call at a time")
        }
        TryLockError::Poisoned(_) => Failure::new(
            ISV_ERROR_INTERNAL,
            "a fault of isv in an earlier call left the handle unusable: free it",
        ),
    })
}

impl Table {
    fn missing<H: Handle>(&self, number: usize) -> Failure {
        let name = H::NAME;
        let order = (number & !MARK) >> MARK_BITS;
        let why = match number {
            0 => format!("the {name} is null"),
            _ if number & MARK == MARK && order > 0 && order <= self.count => {
                format!("the {name} was freed before")
            }
            _ => format!("the {name} did not come from this library: {number:#x}"),
        };
        Failure::new(ISV_ERROR_HANDLE, why)
    }
}

fn wrong_type<H: Handle>(found: &str) -> Failure {
    Failure::new(ISV_ERROR_HANDLE, format!("an {found} was given in place of an {}", H::NAME))
}

/// Returns the number of handles that were not freed yet, of all types. Tests can check that it is 0 at the end.
#[unsafe(no_mangle)]
pub extern "C" fn isv_live_handles() -> usize {
    TABLE.read().unwrap_or_else(PoisonError::into_inner).objects.len()
}
