//! Playlists of HTTP Live Streaming (RFC 8216) for the segments of a ladder of rates.

use crate::Segment;
use std::fmt::Write;

/// Version of the protocol that fragmented MP4 needs (RFC 8216, 7).
const VERSION: u32 = 7;
/// Name of the group that the sound is in.
const SOUND_GROUP: &str = "sound";

/// A rung of a ladder, as its master playlist lists it.
#[derive(Clone, Debug, PartialEq)]
pub struct Rung {
    /// Address of its playlist, relative to the master's.
    pub uri: String,
    /// Highest rate of a segment (bits a second), sound included.
    pub peak_bits: u64,
    /// Mean rate (bits a second), sound included.
    pub mean_bits: u64,
    /// Codecs, as RFC 6381 names them, with commas between them.
    pub codecs: String,
    /// Frames a second.
    pub frame_rate: f64,
}

/// Writes the playlist that lists the rungs, the best first, and the sound that belongs to all of them.
#[must_use]
pub fn master_playlist(rungs: &[Rung], sound: Option<&str>) -> String {
    let mut text = format!("#EXTM3U\n#EXT-X-VERSION:{VERSION}\n#EXT-X-INDEPENDENT-SEGMENTS\n");
    let mut line = |line: String| writeln!(text, "{line}").expect("text grows");
    if let Some(uri) = sound {
        line(format!(
            "#EXT-X-MEDIA:TYPE=AUDIO,GROUP-ID=\"{SOUND_GROUP}\",NAME=\"sound\",DEFAULT=YES,AUTOSELECT=YES,URI=\"{uri}\""
        ));
    }
    for rung in rungs {
        let Rung { uri, peak_bits, mean_bits, codecs, frame_rate } = rung;
        let group = if sound.is_some() { format!(",AUDIO=\"{SOUND_GROUP}\"") } else { String::new() };
        line(format!(
            "#EXT-X-STREAM-INF:BANDWIDTH={peak_bits},AVERAGE-BANDWIDTH={mean_bits},CODECS=\"{codecs}\",FRAME-RATE={frame_rate:.3}{group}"
        ));
        line(uri.clone());
    }
    text
}

/// Writes the playlist of a rung or of the sound: `init.mp4`, then the segments by number. Those of geometry tell their frames.
#[must_use]
pub fn media_playlist(segments: &[Segment], is_geometry: bool) -> String {
    let longest = segments.iter().map(|segment| segment.duration_s).fold(0.0, f64::max);
    // A segment must not round to more than this (RFC 8216, 4.3.3.1).
    let target = longest.round().max(1.0);
    let mut text = format!("#EXTM3U\n#EXT-X-VERSION:{VERSION}\n#EXT-X-TARGETDURATION:{target}\n");
    text += "#EXT-X-PLAYLIST-TYPE:VOD\n#EXT-X-MAP:URI=\"init.mp4\"\n";
    for (number, segment) in segments.iter().enumerate() {
        if is_geometry {
            writeln!(text, "#EXT-X-ISV-FRAMES:{}", segment.samples).expect("text grows");
        }
        writeln!(text, "#EXTINF:{:.6},\n{}", segment.duration_s, segment_name(number)).expect("text grows");
    }
    text + "#EXT-X-ENDLIST\n"
}

/// Name of the file of a segment.
#[must_use]
pub fn segment_name(number: usize) -> String {
    format!("{number:04}.m4s")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn playlists_are_as_players_expect_them() {
        let segments =
            [Segment { samples: 30, duration_s: 1.0 }, Segment { samples: 7, duration_s: 7.0 / 30.0 }];
        let text = media_playlist(&segments, true);
        let lines = [
            "#EXTM3U",
            "#EXT-X-VERSION:7",
            "#EXT-X-TARGETDURATION:1",
            "#EXT-X-PLAYLIST-TYPE:VOD",
            "#EXT-X-MAP:URI=\"init.mp4\"",
            "#EXT-X-ISV-FRAMES:30",
            "#EXTINF:1.000000,",
            "0000.m4s",
            "#EXT-X-ISV-FRAMES:7",
            "#EXTINF:0.233333,",
            "0001.m4s",
            "#EXT-X-ENDLIST",
        ];
        assert_eq!(text.lines().collect::<Vec<_>>(), lines);
        assert!(!media_playlist(&segments, false).contains("FRAMES"));
        let rung = Rung {
            uri: "rung-0/stream.m3u8".to_owned(),
            peak_bits: 1_000_000,
            mean_bits: 800_000,
            codecs: "isv1.1.2,opus".to_owned(),
            frame_rate: 30.0,
        };
        let text = master_playlist(&[rung], Some("sound/stream.m3u8"));
        assert!(text.contains("BANDWIDTH=1000000,AVERAGE-BANDWIDTH=800000,CODECS=\"isv1.1.2,opus\",FRAME-RATE=30.000,AUDIO=\"sound\"\nrung-0/stream.m3u8\n"));
    }
}
