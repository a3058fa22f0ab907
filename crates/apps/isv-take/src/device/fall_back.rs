//! From a device that fails to the CPU.

use super::workers::Fault;
use crate::{Event, Observer};
use std::sync::Arc;

/// A worker on a device, and the CPU to go on with if the device fails.
pub(super) struct FallBack<W: ?Sized> {
    worker: Box<W>,
    /// Makes a worker on the CPU; nothing where that is not wanted, or was done.
    on_cpu: Option<Box<dyn FnOnce() -> Box<W> + Send>>,
    observer: Arc<dyn Observer>,
}

impl<W: ?Sized> FallBack<W> {
    /// A worker that nothing takes the place of.
    pub(super) fn none(worker: Box<W>, observer: &Arc<dyn Observer>) -> Self {
        Self { worker, on_cpu: None, observer: Arc::clone(observer) }
    }

    /// A worker that one on the CPU takes the place of if its device fails.
    pub(super) fn to(
        worker: Box<W>,
        on_cpu: impl FnOnce() -> Box<W> + Send + 'static,
        observer: &Arc<dyn Observer>,
    ) -> Self {
        Self { worker, on_cpu: Some(Box::new(on_cpu)), observer: Arc::clone(observer) }
    }

    /// The worker at work.
    #[cfg(feature = "encode")]
    pub(super) fn worker(&self) -> &W {
        &self.worker
    }

    /// The worker at work.
    pub(super) fn worker_mut(&mut self) -> &mut W {
        &mut self.worker
    }

    /// Whether the CPU can take over.
    pub(super) fn can_fall_back(&self) -> bool {
        self.on_cpu.is_some()
    }

    /// Does a step. If the device fails at it, the observer is told, and the CPU does it and all that follow.
    #[cfg(feature = "encode")]
    pub(super) fn run<T, E: Fault>(&mut self, step: impl Fn(&mut W) -> Result<T, E>) -> Result<T, E> {
        self.run_after(|_| Ok(()), step)
    }

    /// Does a step as [`Self::run`] does. `catch_up` brings a worker on the CPU to where the one that failed was.
    pub(super) fn run_after<T, E: Fault>(
        &mut self,
        catch_up: impl FnOnce(&mut W) -> Result<(), E>,
        step: impl Fn(&mut W) -> Result<T, E>,
    ) -> Result<T, E> {
        let done = step(&mut self.worker);
        let Some(why) = done.as_ref().err().and_then(Fault::of_device) else { return done };
        let Some(on_cpu) = self.on_cpu.take() else { return done };
        self.observer.event(&Event::FellBack(why));
        self.worker = on_cpu();
        catch_up(&mut self.worker)?;
        step(&mut self.worker)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DeviceError;
    use std::sync::Mutex;

    /// A worker that counts its calls.
    trait Count: Send {
        fn count(&mut self) -> Result<u32, Failure>;
    }

    #[derive(Debug, PartialEq)]
    enum Failure {
        Device,
        Input,
    }

    impl Fault for Failure {
        fn of_device(&self) -> Option<DeviceError> {
            (*self == Self::Device).then(|| DeviceError::new("the card was pulled out"))
        }
    }

    /// Counts, and fails at some number.
    struct Counter(u32, Option<(u32, Failure)>);

    impl Count for Counter {
        fn count(&mut self) -> Result<u32, Failure> {
            match &self.1 {
                Some((at, Failure::Device)) if *at <= self.0 => Err(Failure::Device),
                Some((at, Failure::Input)) if *at <= self.0 => Err(Failure::Input),
                _ => {
                    self.0 += 1;
                    Ok(self.0)
                }
            }
        }
    }

    fn run(worker: Counter, falls_back: bool) -> (Vec<Result<u32, Failure>>, Vec<String>) {
        let told = Arc::new(Mutex::new(Vec::new()));
        let heard = Arc::clone(&told);
        let observer: Arc<dyn Observer> =
            Arc::new(move |event: &Event| heard.lock().unwrap().push(event.to_string()));
        let worker: Box<dyn Count> = Box::new(worker);
        let on_cpu = || -> Box<dyn Count> { Box::new(Counter(100, None)) };
        let mut worker = match falls_back {
            true => FallBack::to(worker, on_cpu, &observer),
            false => FallBack::none(worker, &observer),
        };
        let catch_up = |worker: &mut (dyn Count + 'static)| worker.count().map(drop);
        let counts = (0..4).map(|_| worker.run_after(catch_up, Count::count)).collect();
        let told = told.lock().unwrap().clone();
        (counts, told)
    }

    #[test]
    fn the_cpu_catches_up_and_goes_on_where_a_device_fails() {
        let (counts, told) = run(Counter(0, Some((2, Failure::Device))), true);
        assert_eq!(counts, [Ok(1), Ok(2), Ok(102), Ok(103)]);
        assert_eq!(told, ["the card was pulled out: working on the CPU"]);
    }

    #[test]
    fn a_device_that_was_asked_for_is_not_replaced() {
        let (counts, told) = run(Counter(0, Some((3, Failure::Device))), false);
        assert_eq!(counts, [Ok(1), Ok(2), Ok(3), Err(Failure::Device)]);
        assert!(told.is_empty());
    }

    #[test]
    fn what_a_device_was_given_is_no_fault_of_its() {
        let (counts, told) = run(Counter(0, Some((3, Failure::Input))), true);
        assert_eq!(counts, [Ok(1), Ok(2), Ok(3), Err(Failure::Input)]);
        assert!(told.is_empty());
    }
}
