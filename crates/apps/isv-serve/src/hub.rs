//! From one source to all viewers: one ring of packets, which each viewer reads at its own pace.

use crate::message;
use axum::body::Bytes;
use isv_format::StreamHeader;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::watch;
use tokio::time::timeout;

/// What a packet takes in the ring beside its bytes, rounded up.
const SLOT_BYTES: usize = 128;

/// How much is kept for viewers that are behind.
#[derive(Clone, Copy, Debug)]
pub struct HubLimits {
    /// Memory of the ring in bytes, whatever the number of viewers.
    pub ring_bytes: usize,
    /// How old the next packet of a viewer may be before the viewer goes on at the newest entry instead.
    pub lag: Duration,
}

impl Default for HubLimits {
    /// 32 MiB: two minutes of a person at 2 Mbps, or a second of a capture coded without loss. Two seconds: what is later than
    /// that is not live.
    fn default() -> Self {
        Self { ring_bytes: 32 << 20, lag: Duration::from_secs(2) }
    }
}

/// A live stream between its source and its viewers.
///
/// Packets have sequence numbers. The ring holds the newest, within [`HubLimits::ring_bytes`]; a [`Viewer`] holds the number of
/// its next packet and no packets. So a viewer that is slow, or has stopped, costs nothing here and holds up nobody.
#[derive(Debug)]
pub struct Hub {
    limits: HubLimits,
    ring: Mutex<Ring>,
    changed: watch::Sender<()>,
    /// Viewers that were not told yet that the source has ended for good.
    viewers: watch::Sender<usize>,
}

/// What a hub has in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Held {
    /// Packets in the ring.
    pub packets: usize,
    /// Bytes of memory that they take.
    pub bytes: usize,
}

#[derive(Debug, Default)]
struct Ring {
    /// How many streams there were: 0 before the first header.
    streams: u64,
    /// The message that begins the stream.
    header: Bytes,
    /// The message that says what it is.
    metadata: Option<Bytes>,
    /// Whether the source ended and did not start anew.
    ended: bool,
    /// Whether it ended for good.
    finished: bool,
    /// Whether packets have no use until the next entry.
    broken: bool,
    /// Sequence number of the oldest packet, or of the next if there is none.
    first: u64,
    packets: VecDeque<Slot>,
    bytes: usize,
}

#[derive(Debug)]
struct Slot {
    message: Bytes,
    /// Whether decoding can begin here, or begin to recover.
    entry: bool,
    arrived: Instant,
}

impl Ring {
    /// Sequence number of the packet that comes next.
    fn end(&self) -> u64 {
        self.first + self.packets.len() as u64
    }

    fn get(&self, sequence: u64) -> Option<&Slot> {
        self.packets.get(usize::try_from(sequence.checked_sub(self.first)?).ok()?)
    }

    fn newest_entry(&self) -> Option<u64> {
        self.packets.iter().rposition(|slot| slot.entry).map(|at| self.first + at as u64)
    }

    /// The first entry at or after a packet that is not evicted.
    fn entry_from(&self, sequence: u64) -> Option<u64> {
        (sequence..self.end()).find(|sequence| self.get(*sequence).is_some_and(|slot| slot.entry))
    }

    fn push(&mut self, slot: Slot, limit: usize) {
        self.bytes += slot.bytes();
        self.packets.push_back(slot);
        while self.bytes > limit {
            let oldest = self.packets.pop_front().expect("what takes memory is in the ring");
            self.bytes -= oldest.bytes();
            self.first += 1;
        }
    }

    fn clear(&mut self) {
        (self.first, self.bytes) = (self.end(), 0);
        self.packets.clear();
    }
}

impl Slot {
    fn bytes(&self) -> usize {
        self.message.len() + SLOT_BYTES
    }
}

impl Hub {
    /// A hub without a stream.
    #[must_use]
    pub fn new(limits: HubLimits) -> Self {
        Self {
            limits,
            ring: Mutex::default(),
            changed: watch::Sender::default(),
            viewers: watch::Sender::default(),
        }
    }

    /// The largest packet worth reading: a quarter of the ring.
    #[must_use]
    pub fn largest_packet(&self) -> usize {
        self.limits.ring_bytes / 4
    }

    /// A stream begins, in the place of the one before.
    pub fn start(&self, header: &[u8; StreamHeader::BYTES]) {
        let header = message::header(header);
        self.update(|ring| {
            ring.clear();
            ring.metadata = None;
            (ring.streams, ring.header, ring.ended, ring.broken) = (ring.streams + 1, header, false, true);
        });
    }

    /// The packet of metadata, header and payload, has arrived: of a stream the first one counts.
    pub fn describe(&self, packet: &[u8]) {
        let message = message::metadata(packet);
        self.update(|ring| {
            ring.metadata.get_or_insert(message);
        });
    }

    /// A frame's packet, header and payload, has arrived. Those that follow a gap are dropped until an entry: a keyframe, or
    /// another frame whose symbols need none before it.
    pub fn publish(&self, packet: &[u8], entry: bool) {
        let message = message::packet(packet, entry, message::unix_ms());
        let slot = Slot { message, entry, arrived: Instant::now() };
        let limit = self.limits.ring_bytes;
        self.update(|ring| {
            ring.broken &= !entry;
            if !ring.broken {
                ring.push(slot, limit);
            }
        });
    }

    /// Something was lost: nothing can be decoded until the next entry.
    pub fn gap(&self) {
        self.update(|ring| ring.broken = true);
    }

    /// The source ended. Viewers are told once they have all packets.
    pub fn end(&self) {
        self.update(|ring| ring.ended = true);
    }

    /// The source has ended and will not start anew. Viewers are told once they have all packets.
    pub fn finish(&self) {
        self.update(|ring| (ring.ended, ring.finished) = (true, true));
    }

    /// Waits until the source has ended for good and all viewers have the rest of it, or `grace` has passed since it ended.
    pub async fn finished(&self, grace: Duration) {
        let mut changed = self.changed.subscribe();
        while !self.lock().finished {
            // The sender lives in the hub.
            let _ = changed.changed().await;
        }
        let mut viewers = self.viewers.subscribe();
        // Viewers that do not read must not keep the server.
        let _ = timeout(grace, viewers.wait_for(|viewers| *viewers == 0)).await;
    }

    /// What is in memory.
    #[must_use]
    pub fn held(&self) -> Held {
        let ring = self.lock();
        Held { packets: ring.packets.len(), bytes: ring.bytes }
    }

    /// A viewer who sees the stream from the next entry on.
    #[must_use]
    pub fn join(self: &Arc<Self>) -> Viewer {
        self.viewers.send_modify(|viewers| *viewers += 1);
        Viewer {
            changed: self.changed.subscribe(),
            stream: 0,
            next: self.lock().end(),
            place: Place::BeforeEntry,
            told_metadata: false,
            told_end: false,
            is_over: false,
            missed: 0,
            hub: Arc::clone(self),
        }
    }

    fn update(&self, change: impl FnOnce(&mut Ring)) {
        change(&mut self.lock());
        self.changed.send_replace(());
    }

    /// No code can panic while it holds the ring, but a poisoned one would be whole.
    fn lock(&self) -> MutexGuard<'_, Ring> {
        self.ring.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A reader of a hub.
#[derive(Debug)]
pub struct Viewer {
    hub: Arc<Hub>,
    changed: watch::Receiver<()>,
    /// The stream whose header was given out; 0 before the first.
    stream: u64,
    /// Sequence number of the next packet.
    next: u64,
    place: Place,
    told_metadata: bool,
    told_end: bool,
    is_over: bool,
    missed: u64,
}

/// Place of a viewer in the stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    /// It has no packet yet.
    BeforeEntry,
    /// It has the packet before the next one.
    Inside,
    /// Packets that it should have had are gone.
    AfterGap,
}

impl Viewer {
    /// The next message for this viewer. May be abandoned while it waits.
    pub async fn next(&mut self) -> Bytes {
        loop {
            self.changed.mark_unchanged();
            if let Some(message) = self.take(Instant::now()) {
                return message;
            }
            // The sender lives in the hub, which this keeps alive.
            let _ = self.changed.changed().await;
        }
    }

    /// Whether this viewer was told that the source has ended for good: no message follows.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.is_over
    }

    /// Packets of streams it was inside of that this viewer did not get because it was too slow.
    #[must_use]
    pub fn missed(&self) -> u64 {
        self.missed
    }

    /// The next message, if there is one now.
    fn take(&mut self, now: Instant) -> Option<Bytes> {
        let hub = Arc::clone(&self.hub);
        let ring = hub.lock();
        if self.stream != ring.streams {
            self.begin(&ring);
            return Some(ring.header.clone());
        }
        if !self.told_metadata
            && let Some(metadata) = &ring.metadata
        {
            self.told_metadata = true;
            return Some(metadata.clone());
        }
        self.drop_what_is_too_old(&ring, now, hub.limits.lag);
        if self.place != Place::Inside {
            let entry = ring.entry_from(self.next);
            self.pass_to(entry.unwrap_or(ring.end()));
        }
        if let Some(slot) = ring.get(self.next) {
            self.next += 1;
            self.place = Place::Inside;
            return Some(slot.message.clone());
        }
        if ring.ended && !self.told_end {
            self.told_end = true;
            return Some(message::end());
        }
        if ring.finished && !self.is_over {
            self.is_over = true;
            return Some(message::end_for_good());
        }
        None
    }

    fn begin(&mut self, ring: &Ring) {
        self.stream = ring.streams;
        self.next = self.next.max(ring.first);
        self.place = Place::BeforeEntry;
        (self.told_metadata, self.told_end) = (false, false);
    }

    /// What was evicted is lost; what is older than `lag` is passed over if an entry has come since.
    fn drop_what_is_too_old(&mut self, ring: &Ring, now: Instant, lag: Duration) {
        if self.next < ring.first {
            self.lose_until(ring.first);
        }
        let is_late = ring.get(self.next).is_some_and(|slot| now.duration_since(slot.arrived) > lag);
        if is_late && let Some(entry) = ring.newest_entry().filter(|entry| *entry > self.next) {
            self.lose_until(entry);
        }
    }

    fn lose_until(&mut self, sequence: u64) {
        if self.place == Place::Inside {
            self.place = Place::AfterGap;
        }
        self.pass_to(sequence);
    }

    fn pass_to(&mut self, sequence: u64) {
        if self.place == Place::AfterGap {
            self.missed += sequence - self.next;
        }
        self.next = sequence;
    }
}

impl Drop for Viewer {
    fn drop(&mut self) {
        self.hub.viewers.send_modify(|viewers| *viewers -= 1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAG: Duration = Duration::from_secs(2);

    fn hub(ring_bytes: usize) -> Arc<Hub> {
        let hub = Hub::new(HubLimits { ring_bytes, lag: LAG });
        hub.start(&[9; StreamHeader::BYTES]);
        Arc::new(hub)
    }

    /// A packet of 100 bytes, all of them its number.
    fn publish(hub: &Hub, numbers: std::ops::Range<u8>) {
        numbers.for_each(|number| hub.publish(&[number; 100], number.is_multiple_of(10)));
    }

    /// The messages that are there now: of packets their numbers, of others their kinds.
    fn drain(viewer: &mut Viewer) -> Vec<String> {
        drain_at(viewer, Instant::now())
    }

    fn drain_at(viewer: &mut Viewer, now: Instant) -> Vec<String> {
        let describe = |message: Bytes| match message[0] {
            message::PACKET | message::ENTRY => message[9].to_string(),
            message::HEADER => "header".to_owned(),
            kind => format!("kind {kind}"),
        };
        std::iter::from_fn(|| viewer.take(now)).map(describe).collect()
    }

    fn numbers(range: std::ops::Range<u8>) -> Vec<String> {
        range.map(|number| number.to_string()).collect()
    }

    #[test]
    fn who_joins_waits_for_a_keyframe() {
        let hub = hub(1 << 20);
        publish(&hub, 0..15);
        let mut viewer = hub.join();
        assert_eq!(drain(&mut viewer), ["header"]);
        publish(&hub, 15..20);
        assert!(drain(&mut viewer).is_empty());
        publish(&hub, 20..30);
        assert_eq!(drain(&mut viewer), numbers(20..30));
        assert_eq!(viewer.missed(), 0);
    }

    #[test]
    fn who_joins_before_the_stream_has_all_of_it() {
        let hub = Arc::new(Hub::new(HubLimits::default()));
        let mut viewer = hub.join();
        assert!(drain(&mut viewer).is_empty());
        hub.start(&[9; StreamHeader::BYTES]);
        publish(&hub, 0..3);
        assert_eq!(drain(&mut viewer), ["header", "0", "1", "2"]);
    }

    #[test]
    fn all_viewers_of_a_stream_are_told_what_it_is() {
        let hub = hub(1 << 20);
        let mut early = hub.join();
        assert_eq!(drain(&mut early), ["header"]);
        hub.describe(b"first");
        hub.describe(b"second");
        publish(&hub, 0..2);
        assert_eq!(drain(&mut early), ["kind 5", "0", "1"]);
        let mut late = hub.join();
        assert_eq!(drain(&mut late), ["header", "kind 5"]);
        publish(&hub, 10..11);
        assert_eq!(drain(&mut late), ["10"]);
        assert_eq!(&hub.lock().metadata.as_ref().unwrap()[1..], b"first");
        hub.start(&[8; StreamHeader::BYTES]);
        assert_eq!(drain(&mut late), ["header"], "another stream");
    }

    #[test]
    fn the_ring_is_bounded_whatever_viewers_do() {
        let limit = 5000;
        let hub = hub(limit);
        let mut viewers: Vec<_> = (0..50).map(|_| hub.join()).collect();
        for _ in 0..100 {
            publish(&hub, 0..100);
            drain(&mut viewers[0]);
            assert!(hub.held().bytes <= limit, "{:?}", hub.held());
        }
        let bytes = 100 + 9 + SLOT_BYTES;
        assert_eq!(hub.held(), Held { packets: limit / bytes, bytes: limit / bytes * bytes });
    }

    #[test]
    fn who_is_overtaken_goes_on_at_a_keyframe_and_others_miss_nothing() {
        let hub = hub(25 * (100 + 9 + SLOT_BYTES));
        let (mut slow, mut fast) = (hub.join(), hub.join());
        publish(&hub, 0..5);
        assert_eq!(drain(&mut slow), [vec!["header".to_owned()], numbers(0..5)].concat());
        let mut seen = drain(&mut fast);
        for first in (5..65).step_by(5) {
            publish(&hub, first..first + 5);
            seen.extend(drain(&mut fast));
        }
        assert_eq!(seen[1..], numbers(0..65));
        // 40 to 64 are held: the next keyframe is 40 itself.
        assert_eq!(drain(&mut slow), numbers(40..65));
        assert_eq!((slow.missed(), fast.missed()), (35, 0));
        publish(&hub, 65..97);
        // 72 to 96 are held.
        assert_eq!(drain(&mut slow), numbers(80..97));
        assert_eq!(slow.missed(), 35 + 15);
    }

    #[test]
    fn who_is_late_goes_on_at_the_newest_keyframe() {
        let hub = hub(1 << 20);
        let mut viewer = hub.join();
        publish(&hub, 0..35);
        let soon = Instant::now();
        assert_eq!(viewer.take(soon).unwrap()[0], message::HEADER);
        assert_eq!(viewer.take(soon).unwrap()[9], 0);
        assert_eq!(drain_at(&mut viewer, soon + 2 * LAG), numbers(30..35));
        assert_eq!(viewer.missed(), 29);
        // Without a newer keyframe the old packets are better than none.
        publish(&hub, 35..40);
        assert_eq!(drain_at(&mut viewer, soon + 4 * LAG), numbers(35..40));
    }

    #[test]
    fn nothing_is_given_out_between_a_gap_and_a_keyframe() {
        let hub = hub(1 << 20);
        let mut viewer = hub.join();
        publish(&hub, 1..3);
        publish(&hub, 10..13);
        hub.gap();
        publish(&hub, 14..22);
        assert_eq!(drain(&mut viewer), ["header", "10", "11", "12", "20", "21"]);
    }

    #[test]
    fn a_source_that_starts_anew_does_so_for_all() {
        let hub = hub(1 << 20);
        let mut viewer = hub.join();
        publish(&hub, 0..3);
        hub.end();
        assert_eq!(drain(&mut viewer), ["header", "0", "1", "2", "kind 2"]);
        assert!(drain(&mut viewer).is_empty());
        assert_eq!(drain(&mut hub.join()), ["header", "kind 2"]);
        hub.start(&[8; StreamHeader::BYTES]);
        publish(&hub, 3..12);
        assert_eq!(drain(&mut viewer), ["header", "10", "11"]);
        assert_eq!((viewer.missed(), hub.held().packets), (0, 2));
    }

    #[test]
    fn the_end_for_good_comes_last_and_once() {
        let hub = hub(1 << 20);
        let mut viewer = hub.join();
        publish(&hub, 0..3);
        hub.finish();
        assert_eq!(viewer.take(Instant::now()).unwrap()[0], message::HEADER);
        assert_eq!(drain(&mut viewer)[..2], ["0", "1"]);
        assert!(viewer.is_over());
        assert!(drain(&mut viewer).is_empty());
        let mut late = hub.join();
        assert_eq!(drain(&mut late), ["header", "kind 2", "kind 2"]);
        // Before any stream there is no header.
        let empty = Arc::new(Hub::new(HubLimits::default()));
        empty.finish();
        let messages: Vec<_> = {
            let mut viewer = empty.join();
            std::iter::from_fn(|| viewer.take(Instant::now())).collect()
        };
        assert_eq!(messages, [&[message::END][..], &[message::END, message::FOR_GOOD]]);
    }

    #[tokio::test(start_paused = true)]
    async fn a_hub_is_finished_when_viewers_are_or_the_grace_is_over() {
        let grace = Duration::from_secs(5);
        let start = tokio::time::Instant::now();
        let hub = hub(1 << 20);
        assert!(timeout(10 * grace, hub.finished(grace)).await.is_err(), "the source goes on");
        let (viewer, stuck) = (hub.join(), hub.join());
        hub.finish();
        assert!(timeout(grace / 2, hub.finished(grace)).await.is_err(), "viewers do not have the rest");
        drop(viewer);
        hub.finished(grace).await;
        assert_eq!(start.elapsed(), 10 * grace + grace / 2 + grace);
        drop(stuck);
        hub.finished(grace).await;
        assert_eq!(start.elapsed(), 10 * grace + grace / 2 + grace, "at once");
    }

    #[test]
    fn a_packet_larger_than_the_ring_is_a_gap() {
        let hub = hub(1000);
        let mut viewer = hub.join();
        hub.publish(&[0; 2000], true);
        publish(&hub, 1..3);
        assert_eq!(drain(&mut viewer), ["header"], "what follows a keyframe that is gone cannot be decoded");
        assert!(hub.held().bytes <= 1000);
    }
}
