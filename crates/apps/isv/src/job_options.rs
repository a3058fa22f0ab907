//! Options that encoding and decoding share.

use crate::event::{EventHandler, ProgressHandler, observer};
use crate::{Error, ErrorKind};
use isv_take::{Cancellation, Device, Observer};
use std::sync::Arc;

/// Options of a job, whatever it does.
#[derive(Clone, Default)]
pub(crate) struct JobOptions {
    pub(crate) device: Device,
    pub(crate) cancellation: Cancellation,
    pub(crate) events: Option<EventHandler>,
    pub(crate) progress: Option<ProgressHandler>,
    /// First value that no option can hold.
    wrong: Option<String>,
}

impl JobOptions {
    /// An origin as the options keep it. Refuses coordinates that are not finite.
    pub(crate) fn origin(&mut self, place: [f64; 3]) -> Option<[f64; 3]> {
        let is_finite = place.iter().all(|coordinate| coordinate.is_finite());
        if !is_finite {
            self.refuse(format!("origin {place:?}: coordinates are finite"));
        }
        is_finite.then_some(place)
    }

    /// Keeps the first wrong value, for [`Self::check`].
    pub(crate) fn refuse(&mut self, why: String) {
        self.wrong.get_or_insert(why);
    }

    /// Checks that no value was refused.
    ///
    /// # Errors
    /// [`ErrorKind::Options`] for the first wrong value.
    pub(crate) fn check(&self) -> Result<(), Error> {
        self.wrong.as_ref().map_or(Ok(()), |wrong| Err(Error::new(ErrorKind::Options, wrong)))
    }

    /// Creates the observer of a job: `tracing`, and the user's handler.
    pub(crate) fn observer(&self) -> Arc<dyn Observer> {
        observer(self.events.clone())
    }
}
