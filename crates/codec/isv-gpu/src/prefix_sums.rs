//! Sums over long lists.

use crate::commands::Commands;
use crate::kernel::{Kernel, Shader};
use crate::{Gpu, GpuError, Storage};

pub(crate) const SHADER: Shader =
    Shader { name: "prefix sums", parts: &[include_str!("shaders/prefix_sums.wgsl")] };

/// Values that a workgroup sums.
const GROUP: u32 = 1024;

/// Replaces each of a list of pairs of numbers by the sum of those before it. Sums stay at `u32::MAX` rather than wrap.
#[derive(Debug)]
pub(crate) struct PrefixSums {
    sum: Kernel,
    add: Kernel,
}

/// A list in the buffer: the one that is summed, or the totals of a list's workgroups.
#[derive(Clone, Copy, Debug)]
struct List {
    start: u32,
    count: u32,
}

impl List {
    fn groups(self) -> u32 {
        self.count.div_ceil(GROUP)
    }

    /// The totals of its workgroups, which lie behind it.
    fn totals(self) -> Self {
        Self { start: self.start + self.count, count: self.groups() }
    }
}

impl PrefixSums {
    /// Compiles the kernels.
    ///
    /// # Errors
    /// As [`Kernel::new`].
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let kernel = |entry| Kernel::new(gpu, &SHADER, entry, 0);
        Ok(Self { sum: kernel("sum")?, add: kernel("add")? })
    }

    /// Bytes of a list of so many pairs, with what the sums need behind it.
    pub(crate) fn bytes(count: u32) -> u64 {
        let last = lists(count).last().map_or(0, |list| u64::from(list.start) + u64::from(list.count) + 1);
        8 * last
    }

    /// Sums the first `count` pairs of a buffer of [`Self::bytes`].
    ///
    /// # Errors
    /// As [`Commands::run`].
    pub(crate) fn run(&self, commands: &mut Commands, values: &Storage, count: u32) -> Result<(), GpuError> {
        let lists: Vec<List> = lists(count).collect();
        let parameters = |list: &List| [list.start, list.count, list.totals().start, 0];
        for list in &lists {
            commands.run(&self.sum, None, &parameters(list), &[values], list.groups())?;
        }
        // The last list has one total, that of all.
        for list in lists.iter().rev().skip(1) {
            commands.run(&self.add, None, &parameters(list), &[values], list.groups())?;
        }
        Ok(())
    }
}

/// The list, its totals, the totals of those, and so on until a workgroup sums them.
fn lists(count: u32) -> impl Iterator<Item = List> {
    let next = |list: &List| (list.groups() > 1).then(|| list.totals());
    std::iter::successors(Some(List { start: 0, count }), next)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::GpuChoice;
    use crate::storage::{Usage, write};
    use isv_testkit::{Need, skip};

    /// What the kernels leave of a list.
    fn summed(gpu: &Gpu, values: &[[u32; 2]]) -> Vec<[u32; 2]> {
        let (count, bytes) = (values.len() as u32, size_of_val(values) as u64);
        let storage = gpu.storage("values", PrefixSums::bytes(count), Usage::Kernels).unwrap();
        let reading = gpu.storage("sums", bytes, Usage::Reading).unwrap();
        write(gpu, &storage, 0, bytemuck::cast_slice(values));
        let mut commands = Commands::new(gpu);
        PrefixSums::new(gpu).unwrap().run(&mut commands, &storage, count).unwrap();
        commands.copy(&storage, &reading, bytes);
        commands.submit().unwrap();
        bytemuck::pod_collect_to_vec(&gpu.read(&[(&reading, reading.bytes())]).unwrap()[0])
    }

    #[test]
    fn lists_of_all_lengths_are_summed() {
        let gpu = match Gpu::open(&GpuChoice { software: true, ..GpuChoice::default() }) {
            Ok(gpu) => gpu,
            Err(error) => return skip(Need::Gpu, error),
        };
        // The last one needs totals of totals.
        for count in [1, 4, 1023, 1024, 1025, 70_001, 1 << 20, (1 << 20) + 1] {
            let value = |i: u32| i.wrapping_mul(2_654_435_761) >> 21;
            let values: Vec<_> = (0..count).map(|i| [value(i), u32::from(i % 3 == 0)]).collect();
            let mut sum = [0; 2];
            let expected = values.iter().map(|value| {
                let before = sum;
                sum = [sum[0] + value[0], sum[1] + value[1]];
                before
            });
            assert!(summed(&gpu, &values) == expected.collect::<Vec<_>>(), "{count}");
        }
        let large = summed(&gpu, &[[1 << 20, 1]; 5000]);
        assert_eq!(large[4095..4098], [[4095 << 20, 4095], [u32::MAX, 4096], [u32::MAX, 4097]]);
    }
}
