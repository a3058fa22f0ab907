//! Time of the codec's stages: its spans, added up by name.

use std::collections::BTreeMap;
use std::mem::take;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tracing::Subscriber;
use tracing::span::Id;
use tracing_subscriber::layer::{Context, Layer, SubscriberExt};
use tracing_subscriber::registry::{LookupSpan, Registry};

/// Adds up the time that is spent in spans, until asked. Stages that run at the same time each count in full.
#[derive(Clone, Debug, Default)]
pub struct Stages(Arc<Mutex<BTreeMap<&'static str, Duration>>>);

impl Stages {
    /// Listens to the spans of the whole process from now on; if somebody does already, nothing is heard.
    #[must_use]
    pub fn listen() -> Self {
        let stages = Self::default();
        // A second listener only ever hears nothing, which is what it reports.
        let _ = tracing::subscriber::set_global_default(Registry::default().with(stages.clone()));
        stages
    }

    /// Milliseconds since the last call, by stage.
    #[must_use]
    pub fn take_milliseconds(&self) -> BTreeMap<&'static str, f64> {
        let stages = take(&mut *self.times());
        stages.into_iter().map(|(name, time)| (name, time.as_secs_f64() * 1e3)).collect()
    }

    fn times(&self) -> MutexGuard<'_, BTreeMap<&'static str, Duration>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// When a span was entered.
struct Entered(Instant);

impl<S: Subscriber + for<'a> LookupSpan<'a>> Layer<S> for Stages {
    fn on_enter(&self, id: &Id, context: Context<'_, S>) {
        if let Some(span) = context.span(id) {
            span.extensions_mut().replace(Entered(Instant::now()));
        }
    }

    fn on_exit(&self, id: &Id, context: Context<'_, S>) {
        let Some(span) = context.span(id) else { return };
        if let Some(Entered(start)) = span.extensions_mut().remove() {
            *self.times().entry(span.name()).or_default() += start.elapsed();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::thread::sleep;

    #[test]
    fn time_in_spans_is_added_up_by_name_and_taken() {
        let stages = Stages::default();
        let subscriber = Registry::default().with(stages.clone());
        let pause = Duration::from_millis(3);
        tracing::subscriber::with_default(subscriber, || {
            for _ in 0..2 {
                tracing::debug_span!("pause").in_scope(|| sleep(pause));
            }
            tracing::debug_span!("nothing").in_scope(|| ());
        });
        let times = stages.take_milliseconds();
        assert_eq!(times.keys().copied().collect::<Vec<_>>(), ["nothing", "pause"]);
        assert!(times["pause"] >= 6.0 && times["nothing"] < times["pause"], "{times:?}");
        assert!(stages.take_milliseconds().is_empty());
    }
}
