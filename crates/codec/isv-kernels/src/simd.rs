//! Plain loops, compiled for each instruction set, and the one place that decides which of them runs.
//!
//! The best set that the machine has is used, unless [`choose`] says otherwise. Results are the same in all of them, bit for bit,
//! so a choice changes nothing but speed and may be made at any time. It is for tests, for counting instructions and for finding
//! out whether an instruction set is to blame.

use fearless_simd::{Level, Simd, dispatch};
use std::fmt;
use std::str::FromStr;
use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::{Mutex, PoisonError};

/// The environment variable that programs choose by: a name that [`Instructions`] are parsed from.
pub const VARIABLE: &str = "ISV_SIMD";

/// A set of vector instructions that loops are compiled for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Instructions {
    /// The best that the machine has.
    #[default]
    Best,
    /// None but those of every machine of the target, which the compiler may still use for plain loops. Explicit vectors are
    /// worked on lane by lane. The reference.
    Scalar,
    /// x86: SSE2, which every machine of 64 bits has.
    Sse2,
    /// x86: SSE4.2.
    Sse42,
    /// x86: AVX2, FMA and what came with them.
    Avx2,
    /// x86: AVX-512 as of Ice Lake.
    Avx512,
    /// Arm of 64 bits: NEON.
    Neon,
    /// WebAssembly: simd128.
    Simd128,
}

/// All sets and their names, by number; of those of one kind of machine, the lesser come first.
const NAMES: [(Instructions, &str); 8] = [
    (Instructions::Best, "auto"),
    (Instructions::Scalar, "scalar"),
    (Instructions::Sse2, "sse2"),
    (Instructions::Sse42, "sse4.2"),
    (Instructions::Avx2, "avx2"),
    (Instructions::Avx512, "avx512"),
    (Instructions::Neon, "neon"),
    (Instructions::Simd128, "simd128"),
];

impl Instructions {
    /// The sets that this machine has, from [`Self::Scalar`] to the best; each by its own name.
    pub fn available() -> impl Iterator<Item = Self> {
        let sets = NAMES.into_iter().map(|(set, _)| set).filter(|set| *set != Self::Best);
        sets.filter(|set| set.level().is_some())
    }

    /// The level to dispatch to; nothing if this machine does not have it.
    fn level(self) -> Option<Level> {
        let best = Level::new();
        match self {
            Self::Best => Some(best),
            Self::Scalar => Some(Level::fallback()),
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            Self::Sse2 => best.as_sse2().map(Simd::level),
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            Self::Sse42 => best.as_sse4_2().map(Simd::level),
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            Self::Avx2 => best.as_avx2().map(Simd::level),
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            Self::Avx512 => best.as_avx512().map(Simd::level),
            #[cfg(target_arch = "aarch64")]
            Self::Neon => best.as_neon().map(Simd::level),
            #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
            Self::Simd128 => best.as_wasm_simd128().map(Simd::level),
            _ => None,
        }
    }

    /// The name of the best set of this machine.
    fn best() -> Self {
        Self::available().last().unwrap_or(Self::Scalar)
    }
}

impl fmt::Display for Instructions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(NAMES[usize::from(*self as u8)].1)
    }
}

impl FromStr for Instructions {
    type Err = ChoiceError;

    fn from_str(name: &str) -> Result<Self, ChoiceError> {
        let found = NAMES.into_iter().find(|(_, known)| *known == name);
        found.map(|(set, _)| set).ok_or_else(|| ChoiceError::Unknown(name.to_owned()))
    }
}

/// Why instructions cannot be chosen.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ChoiceError {
    /// No set has this name.
    Unknown(String),
    /// This machine does not have them.
    Missing(Instructions),
}

impl fmt::Display for ChoiceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let list = |sets: &mut dyn Iterator<Item = String>| sets.collect::<Vec<_>>().join(", ");
        match self {
            Self::Unknown(name) => {
                let names = list(&mut NAMES.iter().map(|(_, name)| (*name).to_owned()));
                write!(f, "'{name}' is no instruction set: there are {names}")
            }
            Self::Missing(set) => {
                let names = list(&mut Instructions::available().map(|set| set.to_string()));
                write!(f, "this machine does not have {set}: it has {names}")
            }
        }
    }
}

impl std::error::Error for ChoiceError {}

/// What was chosen, as a number; the best set of the machine is never kept by its own name.
static CHOSEN: AtomicU8 = AtomicU8::new(Instructions::Best as u8);

/// Makes all loops of the process use these instructions from now on.
///
/// # Errors
/// If the machine does not have them.
pub fn choose(instructions: Instructions) -> Result<(), ChoiceError> {
    if instructions.level().is_none() {
        return Err(ChoiceError::Missing(instructions));
    }
    let is_best = instructions == Instructions::best();
    let kept = if is_best { Instructions::Best } else { instructions };
    CHOSEN.store(kept as u8, Ordering::Relaxed);
    Ok(())
}

/// [`choose`], by the environment variable [`VARIABLE`], if it is there.
///
/// # Errors
/// If it names no instruction set, or one that the machine does not have.
pub fn choose_by_environment() -> Result<(), ChoiceError> {
    std::env::var_os(VARIABLE).map_or(Ok(()), |name| choose(name.to_string_lossy().parse()?))
}

/// The instructions that are used now, by their own name.
#[must_use]
pub fn in_use() -> Instructions {
    match chosen() {
        Instructions::Best => Instructions::best(),
        chosen => chosen,
    }
}

#[inline(always)]
fn chosen() -> Instructions {
    NAMES[usize::from(CHOSEN.load(Ordering::Relaxed)) % NAMES.len()].0
}

/// What [`dispatch!`] is to be given, always.
#[inline(always)]
#[must_use]
pub fn level() -> Level {
    if CHOSEN.load(Ordering::Relaxed) == Instructions::Best as u8 { Level::new() } else { chosen_level() }
}

#[cold]
fn chosen_level() -> Level {
    chosen().level().unwrap_or(Level::new())
}

/// Runs a piece of work with each instruction set that the machine has, for tests and benchmarks. One caller at a time; what the
/// process does otherwise changes its instructions, too. What was chosen before is chosen again. `work` may not call this.
pub fn with_each<R>(mut work: impl FnMut() -> R) -> Vec<(Instructions, R)> {
    static TURN: Mutex<()> = Mutex::new(());
    let _turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
    let _restore = Restore(CHOSEN.load(Ordering::Relaxed));
    let run = |set: Instructions| choose(set).ok().map(|()| (set, work()));
    Instructions::available().filter_map(run).collect()
}

/// Chooses what was chosen before, even if the work panics.
struct Restore(u8);

impl Drop for Restore {
    fn drop(&mut self) {
        CHOSEN.store(self.0, Ordering::Relaxed);
    }
}

/// Runs a piece of work compiled for the instructions that are in use (AVX-512, AVX2, SSE4.2, NEON, simd128 or none). Whatever
/// the work inlines is compiled with it. Integer and floating-point results are those of the plain code, bit for bit, for the
/// compiler neither reorders nor fuses operations.
///
/// `work` and all that it calls must be marked `#[inline(always)]`; what is not inlined is compiled for the baseline.
#[inline(always)]
pub fn vectorized<R>(work: impl FnOnce() -> R) -> R {
    dispatch!(level(), simd => simd.vectorize(work))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_as_they_are_written() {
        for (set, name) in NAMES {
            assert_eq!((set.to_string().as_str(), name.parse()), (name, Ok(set)));
        }
        let sentence = "mmx".parse::<Instructions>().unwrap_err().to_string();
        assert!(sentence.starts_with("'mmx' is no instruction set: there are auto, scalar,"), "{sentence}");
    }

    #[test]
    fn what_the_machine_has_can_be_chosen_and_nothing_else() {
        let runs = with_each(|| (in_use(), level().is_fallback()));
        assert!(runs.iter().map(|run| run.0).eq(Instructions::available()));
        for (set, (used, is_scalar)) in runs {
            assert_eq!((used, is_scalar), (set, set == Instructions::Scalar));
        }
        let missing = |set: &Instructions| *set != Instructions::Best && set.level().is_none();
        for set in NAMES.into_iter().map(|(set, _)| set).filter(missing) {
            assert_eq!(choose(set), Err(ChoiceError::Missing(set)));
            let sentence = ChoiceError::Missing(set).to_string();
            assert!(sentence.contains(&format!("does not have {set}: it has scalar")), "{sentence}");
        }
        // A choice does not outlast work that panics.
        assert!(std::panic::catch_unwind(|| with_each(|| panic!("in the middle"))).is_err());
        assert_eq!(chosen(), Instructions::Best);
    }
}
