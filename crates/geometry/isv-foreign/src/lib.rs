//! Calls into parsers that are not ours.

use std::cell::Cell;
use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;

thread_local! {
    static INSIDE: Cell<bool> = const { Cell::new(false) };
}

/// Keeps the messages of panics in foreign parsers off standard error from now on. They would read as faults
/// of isv, but each is a refusal of a file. The function wraps the panic hook of the whole process: programs
/// call it, and libraries leave the hook alone.
pub fn hush_foreign_panics() {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let previous = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if !INSIDE.get() {
                previous(info);
            }
        }));
    });
}

/// Runs a parser of a foreign library; `None` if it panics.
///
/// The last resort, after everything that can be checked before the call has been. Libraries index their
/// tables with what the file says, and one damaged file must not end a run over thousands. Nothing that the
/// parser touched is used after a panic.
pub fn catch_panic<T>(parse: impl FnOnce() -> T) -> Option<T> {
    let outer = INSIDE.replace(true);
    let result = panic::catch_unwind(AssertUnwindSafe(parse));
    INSIDE.set(outer);
    result.ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_ends_at_the_call() {
        assert_eq!(catch_panic(|| 7), Some(7));
        assert_eq!(catch_panic(|| -> i32 { panic!("never shown") }), None);
        assert!(!INSIDE.get());
    }
}
