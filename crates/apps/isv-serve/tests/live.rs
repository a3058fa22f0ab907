//! The live protocol, and what viewers can and cannot do to the server.

mod support;

use isv_serve::{Hub, HubLimits, LiveLimits, Settings, message};
use std::sync::Arc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use support::{Watcher, hub, live, packet, publish, start, stream_header};
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::protocol::frame::coding::CloseCode;

fn unix_ms() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_secs_f64() * 1e3
}

fn f64_at(bytes: &[u8]) -> f64 {
    f64::from_le_bytes(bytes[..8].try_into().unwrap())
}

/// Joined, with the header received: from now on the viewer misses nothing.
async fn join(address: std::net::SocketAddr) -> Watcher {
    let mut watcher = Watcher::join(address).await;
    watcher.expect(message::HEADER).await;
    watcher
}

#[tokio::test]
async fn a_viewer_gets_header_packets_and_end() {
    let hub = hub();
    let address = start(live(&hub));
    publish(&hub, 0..5, 100);
    let mut watcher = Watcher::join(address).await;
    assert_eq!(watcher.expect(message::HEADER).await[1..], stream_header());
    let before = unix_ms();
    publish(&hub, 5..12, 100);
    let first = watcher.expect(message::ENTRY).await;
    assert_eq!(first[9..], packet(10, 100), "joined in the middle: the next keyframe comes first");
    let arrived = f64_at(&first[1..]);
    assert!((before - 1.0..=unix_ms() + 1.0).contains(&arrived), "{arrived}");
    assert_eq!(watcher.next_packet().await, 11);
    hub.end();
    assert_eq!(watcher.expect(message::END).await, [message::END]);
    hub.start(&[5; 48]);
    assert_eq!(watcher.expect(message::HEADER).await[1..], [5; 48]);
    publish(&hub, 20..21, 100);
    assert_eq!(watcher.next_packet().await, 20);
}

#[tokio::test]
async fn the_end_for_good_closes_the_connection_once_a_viewer_has_all() {
    let hub = hub();
    let address = start(live(&hub));
    let mut watcher = join(address).await;
    publish(&hub, 0..3, 100);
    hub.finish();
    let finished = hub.finished(Duration::from_secs(60));
    for number in 0..3 {
        assert_eq!(watcher.next_packet().await, number);
    }
    assert_eq!(watcher.expect(message::END).await, [message::END]);
    assert_eq!(watcher.expect(message::END).await, [message::END, message::FOR_GOOD]);
    let Some(Message::Close(Some(frame))) = watcher.next().await else { panic!("a close") };
    assert_eq!((frame.code, frame.reason.as_str()), (CloseCode::Normal, "the stream has ended"));
    drop(watcher);
    let begun = std::time::Instant::now();
    finished.await;
    assert!(begun.elapsed() < Duration::from_secs(30), "nobody is waited for any more");
}

#[tokio::test]
async fn a_viewer_may_ask_for_the_time_and_nothing_else() {
    let address = start(live(&hub()));
    let mut watcher = join(address).await;
    let before = unix_ms();
    watcher.send(Message::binary(b"anything".to_vec())).await;
    let answer = watcher.expect(message::CLOCK).await;
    assert_eq!((answer.len(), &answer[9..]), (17, &b"anything"[..]));
    assert!((before - 1.0..=unix_ms() + 1.0).contains(&f64_at(&answer[1..])));

    for wrong in [
        Message::text("12345678"),
        Message::binary(vec![0; 9]),
        Message::binary(vec![0; 0]),
        Message::binary(vec![0; 1 << 20]),
    ] {
        let mut watcher = join(address).await;
        // One that is too large may be cut off while it is sent.
        let _ = futures_util::SinkExt::send(&mut watcher.socket, wrong.clone()).await;
        match watcher.next().await {
            Some(Message::Close(Some(frame))) => assert_eq!(frame.code, CloseCode::Policy),
            Some(Message::Close(None)) | None => assert!(wrong.len() > 125),
            other => panic!("{other:?}"),
        }
        assert!(watcher.next().await.is_none());
    }
    watcher.send(Message::binary(b"still on".to_vec())).await;
    watcher.expect(message::CLOCK).await;
}

#[tokio::test]
async fn a_viewer_that_asks_without_end_is_cut_off() {
    let address = start(live(&hub()));
    for question in [Message::binary(vec![0; 8]), Message::Ping(vec![0; 8].into())] {
        let mut watcher = join(address).await;
        for _ in 0..100 {
            // Fails once it is cut off.
            let _ = futures_util::SinkExt::send(&mut watcher.socket, question.clone()).await;
        }
        let mut answers = 0;
        while let Some(Message::Binary(_)) = watcher.next().await {
            answers += 1;
        }
        assert!(answers < 50, "{answers} answers");
    }
}

#[tokio::test]
async fn seats_are_limited_and_come_free() {
    let live_limits = LiveLimits { viewers: 2, ..LiveLimits::default() };
    let address = start(Settings { live_limits, ..live(&hub()) });
    let (first, _second) = (join(address).await, join(address).await);
    assert_eq!(Watcher::try_join(address, None).await.err(), Some(503));
    drop(first);
    while Watcher::try_join(address, None).await.is_err() {
        tokio::time::sleep(Duration::from_millis(1)).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn fifty_viewers_miss_nothing_and_take_no_more_than_the_ring() {
    let ring_bytes = 1 << 20;
    let hub = Arc::new(Hub::new(HubLimits { ring_bytes, lag: Duration::MAX }));
    hub.start(&stream_header());
    let address = start(live(&hub));
    let mut viewers = Vec::new();
    for _ in 0..50 {
        let mut watcher = join(address).await;
        let (tell, told) = tokio::sync::watch::channel(None);
        let reading = tokio::spawn(async move {
            for expected in 0..300 {
                assert_eq!(watcher.next_packet().await, expected);
                tell.send_replace(Some(expected));
            }
        });
        viewers.push((reading, told));
    }
    for number in 0..300 {
        publish(&hub, number..number + 1, 20_000);
        assert!(hub.held().bytes <= ring_bytes);
        // The next packets come when these have been read, as they do in time, so that no machine is too slow for this.
        if number % 25 == 24 {
            for (_, told) in &mut viewers {
                told.wait_for(|seen| *seen >= Some(number)).await.unwrap();
            }
        }
    }
    for (reading, _) in viewers {
        reading.await.unwrap();
    }
    assert!(hub.held().packets < 60, "{:?}", hub.held());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_viewer_that_stops_reading_goes_on_at_a_keyframe_and_holds_up_nobody() {
    let hub = Arc::new(Hub::new(HubLimits { ring_bytes: 4 << 20, lag: Duration::MAX }));
    hub.start(&stream_header());
    let live_limits = LiveLimits { patience: Duration::from_secs(600), ..LiveLimits::default() };
    let address = start(Settings { live_limits, ..live(&hub) });
    let mut stalled = Watcher::join_narrow(address).await;
    stalled.expect(message::HEADER).await;
    let mut reader = join(address).await;
    // 40 MB, of which the ring, the sockets' buffers and one packet underway hold less than half.
    for number in 0..400 {
        publish(&hub, number..number + 1, 100_000);
        assert_eq!(reader.next_packet().await, number);
    }
    let mut seen = Vec::new();
    while seen.last() != Some(&399) {
        seen.push(stalled.next_packet().await);
    }
    let gaps: Vec<_> = seen.windows(2).filter(|pair| pair[1] != pair[0] + 1).collect();
    assert_eq!(gaps.len(), 1, "{gaps:?}");
    assert!(gaps[0][1] % 10 == 0 && gaps[0][1] - gaps[0][0] > 100, "{gaps:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_viewer_that_never_reads_is_cut_off() {
    let hub = hub();
    let live_limits = LiveLimits { viewers: 1, patience: Duration::from_millis(50), ..LiveLimits::default() };
    let address = start(Settings { live_limits, ..live(&hub) });
    let mut stalled = Watcher::join_narrow(address).await;
    stalled.expect(message::HEADER).await;
    // Its seat comes free although it is still connected.
    for number in 0.. {
        publish(&hub, number * 10..number * 10 + 10, 100_000);
        if Watcher::try_join(address, None).await.is_ok() {
            break;
        }
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_viewer_that_no_longer_answers_is_cut_off() {
    let live_limits = LiveLimits { viewers: 1, ping: Duration::from_millis(20), ..LiveLimits::default() };
    let address = start(Settings { live_limits, ..live(&hub()) });
    // It is there, but nobody reads its socket and so nobody answers pings.
    let silent = Watcher::join(address).await;
    while Watcher::try_join(address, None).await.is_err() {
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    drop(silent);
}
