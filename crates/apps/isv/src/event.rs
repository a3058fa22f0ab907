//! What happens during a job.

use isv_take::Observer;
use std::fmt;
use std::sync::Arc;

/// A thing that happened or was decided, in one sentence.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Event {
    /// The sentence.
    pub text: String,
    /// Whether the result may not be what its user wants.
    pub is_warning: bool,
}

impl From<&isv_take::Event> for Event {
    fn from(event: &isv_take::Event) -> Self {
        Self { text: event.to_string(), is_warning: event.is_warning() }
    }
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

/// Handler of events.
pub(crate) type EventHandler = Arc<dyn Fn(&Event) + Send + Sync>;

/// Handler of the number of frames done, and of all frames if that is known.
#[cfg(feature = "io")]
pub(crate) type ProgressHandler = Arc<dyn Fn(usize, Option<usize>) + Send + Sync>;

/// Hands events to `tracing`, and to a handler if there is one.
pub(crate) fn observer(handler: Option<EventHandler>) -> Arc<dyn Observer> {
    Arc::new(move |event: &isv_take::Event| {
        let event = Event::from(event);
        match event.is_warning {
            true => tracing::warn!("{event}"),
            false => tracing::info!("{event}"),
        }
        if let Some(handler) = &handler {
            handler(&event);
        }
    })
}
