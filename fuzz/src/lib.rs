//! The entry points that libFuzzer calls. What the targets do with bytes is in `isv-hostile`.

pub use {isv_hostile, libfuzzer_sys};

/// Has libFuzzer run a target by its name.
#[macro_export]
macro_rules! run {
    ($name:literal) => {
        use $crate::libfuzzer_sys;

        libfuzzer_sys::fuzz_target!(init: $crate::isv_hostile::on_one_thread(), |bytes: &[u8]| {
            ($crate::isv_hostile::target($name).run)(bytes);
        });

        libfuzzer_sys::fuzz_mutator!(|data: &mut [u8], size: usize, max_size: usize, seed: u32| {
            let target = $crate::isv_hostile::target($name);
            target.mutate(data, size, max_size, seed, &mut libfuzzer_sys::fuzzer_mutate)
        });
    };
}
