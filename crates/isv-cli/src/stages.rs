//! Where the time goes: the spans of the codec, by name.

use crate::stats::milliseconds;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use tracing::Subscriber;
use tracing::span::Id;
use tracing_subscriber::layer::{Context, Layer, SubscriberExt};
use tracing_subscriber::registry::{LookupSpan, Registry};

/// Adds up the time that is spent in spans, until asked.
#[derive(Clone, Debug, Default)]
pub(crate) struct Stages(Arc<Mutex<BTreeMap<&'static str, Duration>>>);

impl Stages {
    /// Listens to the spans of the whole process from now on; if somebody does already, nothing is heard.
    pub(crate) fn listen() -> Self {
        let stages = Self::default();
        // A second listener only ever hears nothing, which is what it reports.
        let _ = tracing::subscriber::set_global_default(Registry::default().with(stages.clone()));
        stages
    }

    /// Milliseconds so far, by stage. Stages that run at the same time each count in full.
    pub(crate) fn milliseconds(&self) -> BTreeMap<&'static str, f64> {
        let stages = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        stages.iter().map(|(name, time)| (*name, milliseconds(*time))).collect()
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
            let mut stages = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            *stages.entry(span.name()).or_default() += start.elapsed();
        }
    }
}
