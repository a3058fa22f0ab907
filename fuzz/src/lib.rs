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
            if target.mutator.is_none() {
                return libfuzzer_sys::fuzzer_mutate(data, size, max_size);
            }
            let changed = target.mutate(&data[..size], max_size, seed, &mut |bytes: &[u8], most| {
                let mut out = bytes.to_vec();
                out.resize(most.max(bytes.len()), 0);
                let length = libfuzzer_sys::fuzzer_mutate(&mut out, bytes.len(), most);
                out.truncate(length);
                out
            });
            data[..changed.len()].copy_from_slice(&changed);
            changed.len()
        });
    };
}
