//! Sound from files: packets as another program coded them, or waveforms coded to Opus.

use crate::boxes::{put, write_box, write_full_box};
use crate::opus::{OpusSource, SAMPLE_RATES};
use crate::{
    Mp4Error, Mp4File, SampleSource, SourceSample, TrackDescription, TrackKind, TrackSource, is_mp4,
};
use isv_foreign::catch_panic;
use mp4_atom::esds::{DecoderConfig, EsDescriptor, SLConfig};
use mp4_atom::{Audio, Esds, Mp4a, Opus, PcmC};
use std::fmt::Display;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use symphonia::core::audio::Channels;
use symphonia::core::codecs::audio::AudioCodecParameters;
use symphonia::core::codecs::audio::well_known::{
    CODEC_ID_FLAC, CODEC_ID_MP3, CODEC_ID_OPUS, CODEC_ID_PCM_F32LE, CODEC_ID_PCM_S16LE, CODEC_ID_PCM_S24LE,
    CODEC_ID_PCM_S32LE, CODEC_ID_PCM_U8,
};
use symphonia::core::errors::Error as SymphoniaError;
use symphonia::core::formats::probe::Hint;
use symphonia::core::formats::{FormatOptions, FormatReader, TrackType};
use symphonia::core::io::{MediaSource, MediaSourceStream};
use symphonia::core::meta::MetadataOptions;

/// Most channels of sound.
const MOST_CHANNELS: usize = 255;
/// Object type of MP3 (MPEG-1 layer 3) in a decoder configuration, as registered.
const MP3_OBJECT_TYPE: u8 = 0x6b;
/// Stream type of sound (14496-1, table 6).
const AUDIO_STREAM: u8 = 5;

/// How sound is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct SoundOptions {
    /// Bits a second to which waveforms are coded with Opus; `None` takes them as they are. Coded sound always stays as it is.
    pub opus_bits_per_second: Option<u32>,
}

impl Default for SoundOptions {
    /// 128 kbps: stereo music that few can tell from the original.
    fn default() -> Self {
        Self { opus_bits_per_second: Some(128_000) }
    }
}

/// Opens the sound of an MP4, MP3, Ogg, FLAC or WAV file, told apart by their first bytes.
///
/// # Errors
/// [`Mp4Error`]: a file without sound, or with sound that MP4 has no name for.
pub fn open_sound<S: Read + Seek + Send + Sync + 'static>(
    mut source: S,
    options: SoundOptions,
) -> Result<Box<dyn SampleSource>, Mp4Error> {
    let mut begin = Vec::new();
    source.by_ref().take(8).read_to_end(&mut begin)?;
    let length = source.seek(SeekFrom::End(0))?;
    source.seek(SeekFrom::Start(0))?;
    if is_mp4(&begin) {
        let file = Mp4File::open(BufReader::new(source))?;
        let track = file.track_of(TrackKind::Sound)?;
        return Ok(Box::new(TrackSource::new(file, track)?));
    }
    let packets = Packets::open(Media { source, length })?;
    match (Waveform::of(&packets.codec), options.opus_bits_per_second) {
        (Some(form), Some(rate)) => Ok(Box::new(OpusSource::new(packets, form, rate)?)),
        _ => Ok(Box::new(PacketSource::new(packets)?)),
    }
}

/// A source as the library wants it.
struct Media<S> {
    source: S,
    length: u64,
}

impl<S: Read> Read for Media<S> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.source.read(buffer)
    }
}

impl<S: Seek> Seek for Media<S> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.source.seek(to)
    }
}

impl<S: Read + Seek + Send + Sync> MediaSource for Media<S> {
    fn is_seekable(&self) -> bool {
        true
    }

    fn byte_len(&self) -> Option<u64> {
        Some(self.length)
    }
}

/// Packets of sound out of a file.
pub(crate) struct Packets {
    /// `None` after a panic.
    reader: Option<Box<dyn FormatReader>>,
    track: u32,
    codec: AudioCodecParameters,
    pub(crate) sample_rate: u32,
    pub(crate) channels: u16,
    /// Sound frames at the begin that only warm a decoder up.
    delay: u32,
}

impl Packets {
    fn open(source: impl MediaSource + 'static) -> Result<Self, Mp4Error> {
        let stream = MediaSourceStream::new(Box::new(source), Default::default());
        let unknown = || Mp4Error::Unsupported("this is no MP4, MP3, Ogg, FLAC or WAV file".to_owned());
        let (format, metadata) = (FormatOptions::default(), MetadataOptions::default());
        let probe = || symphonia::default::get_probe().probe(&Hint::new(), stream, format, metadata);
        let reader = catch_panic(probe).ok_or_else(unknown)?.map_err(|error| match error {
            SymphoniaError::IoError(error) if error.kind() != io::ErrorKind::UnexpectedEof => error.into(),
            _ => unknown(),
        })?;
        let track = reader.default_track(TrackType::Audio).ok_or(Mp4Error::NoTrack("sound"))?;
        let codec = track.codec_params.as_ref().and_then(|codec| codec.audio()).cloned();
        let codec = codec.ok_or(Mp4Error::NoTrack("sound"))?;
        let (Some(sample_rate @ 1..), Some(channels @ 1..=MOST_CHANNELS)) =
            (codec.sample_rate, codec.channels.as_ref().map(Channels::count))
        else {
            return Err(Mp4Error::Unsupported(
                "the sound does not state its sample rate and channels".to_owned(),
            ));
        };
        let (track, delay, channels) = (track.id, track.delay.unwrap_or(0), channels as u16);
        Ok(Self { reader: Some(reader), track, codec, sample_rate, channels, delay })
    }

    /// The next packet with its duration in sound frames; `None` at the end.
    pub(crate) fn next(&mut self) -> Result<Option<(Vec<u8>, u32)>, Mp4Error> {
        let damaged = |what: &dyn Display| Mp4Error::Unsupported(format!("the sound cannot be read: {what}"));
        loop {
            let Some(mut reader) = self.reader.take() else { return Ok(None) };
            let next = catch_panic(|| {
                let next = reader.next_packet();
                (reader, next)
            });
            let (reader, next) = next.ok_or_else(|| damaged(&"it is damaged"))?;
            self.reader = Some(reader);
            let packet = match next {
                Ok(Some(packet)) => packet,
                Ok(None) => return Ok(None),
                Err(SymphoniaError::IoError(error)) if error.kind() == io::ErrorKind::UnexpectedEof => {
                    return Ok(None);
                }
                Err(SymphoniaError::IoError(error)) => return Err(error.into()),
                Err(error) => return Err(damaged(&error)),
            };
            if packet.track_id == self.track {
                // A decoder gives what is to be cut off, too.
                let frames = packet.dur.get() + packet.trim_start.get() + packet.trim_end.get();
                return Ok(Some((packet.data.into_vec(), u32::try_from(frames).unwrap_or(u32::MAX))));
            }
        }
    }
}

/// How a number of a waveform is stored, little-endian.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Waveform {
    U8,
    S16,
    S24,
    S32,
    F32,
}

impl Waveform {
    fn of(codec: &AudioCodecParameters) -> Option<Self> {
        [
            (CODEC_ID_PCM_U8, Self::U8),
            (CODEC_ID_PCM_S16LE, Self::S16),
            (CODEC_ID_PCM_S24LE, Self::S24),
            (CODEC_ID_PCM_S32LE, Self::S32),
            (CODEC_ID_PCM_F32LE, Self::F32),
        ]
        .into_iter()
        .find_map(|(id, form)| (codec.codec == id).then_some(form))
    }

    fn bytes(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::S16 => 2,
            Self::S24 => 3,
            Self::S32 | Self::F32 => 4,
        }
    }

    /// The numbers in bytes, -1 to 1.
    pub(crate) fn numbers(self, bytes: &[u8]) -> impl Iterator<Item = f32> + '_ {
        bytes.chunks_exact(self.bytes()).map(move |number| match (self, number) {
            (Self::U8, [a]) => (f32::from(*a) - 128.0) / 128.0,
            (Self::S16, [a, b]) => f32::from(i16::from_le_bytes([*a, *b])) / 32_768.0,
            (Self::S24, [a, b, c]) => i32::from_le_bytes([0, *a, *b, *c]) as f32 / 2_147_483_648.0,
            (Self::S32, [a, b, c, d]) => i32::from_le_bytes([*a, *b, *c, *d]) as f32 / 2_147_483_648.0,
            (Self::F32, [a, b, c, d]) => {
                let number = f32::from_le_bytes([*a, *b, *c, *d]);
                if number.is_finite() { number.clamp(-1.0, 1.0) } else { 0.0 }
            }
            _ => unreachable!("pieces have the bytes of a number"),
        })
    }
}

/// Packets as they are.
struct PacketSource {
    packets: Packets,
    description: TrackDescription,
    time: u64,
}

impl PacketSource {
    fn new(packets: Packets) -> Result<Self, Mp4Error> {
        let mut description =
            TrackDescription::new(TrackKind::Sound, packets.sample_rate, sample_entry(&packets)?);
        description.edit.media_time = packets.delay.into();
        Ok(Self { packets, description, time: 0 })
    }
}

impl SampleSource for PacketSource {
    fn description(&self) -> &TrackDescription {
        &self.description
    }

    fn next_sample(&mut self) -> Result<Option<SourceSample>, Mp4Error> {
        let Some((data, duration)) = self.packets.next()? else { return Ok(None) };
        let time = self.time;
        self.time += u64::from(duration);
        Ok(Some(SourceSample { time, duration, composition_offset: 0, sync: true, data }))
    }
}

/// The sample entry of sound that stays as it is.
fn sample_entry(packets: &Packets) -> Result<Vec<u8>, Mp4Error> {
    let codec = &packets.codec;
    let extra = codec.extra_data.as_deref().unwrap_or_default();
    let mut entry = Vec::new();
    match codec.codec {
        CODEC_ID_OPUS => put(&mut entry, &opus_entry(extra)?),
        CODEC_ID_MP3 => {
            let config = DecoderConfig {
                object_type_indication: MP3_OBJECT_TYPE,
                stream_type: AUDIO_STREAM,
                ..DecoderConfig::default()
            };
            let es_desc = EsDescriptor {
                es_id: 0,
                dec_config: config,
                sl_config: SLConfig::default(),
                ..Default::default()
            };
            put(
                &mut entry,
                &Mp4a { audio: audio(packets, 16), esds: Esds { es_desc }, btrt: None, taic: None },
            );
        }
        CODEC_ID_FLAC if extra.len() == STREAMINFO_BYTES => {
            let bits = codec.bits_per_sample.unwrap_or(16) as u16;
            write_box(&mut entry, b"fLaC", |out| {
                put(out, &audio(packets, bits));
                write_full_box(out, b"dfLa", |out| {
                    // One block, the last, of type 0.
                    out.extend([0x80, 0, 0, STREAMINFO_BYTES as u8]);
                    out.extend(extra);
                });
            });
        }
        _ if !SAMPLE_RATES.contains(&packets.sample_rate) => {
            let (least, most) = SAMPLE_RATES.into_inner();
            return Err(Mp4Error::Unsupported(format!(
                "waveforms of {least} to {most} Hz are taken, not of {} Hz",
                packets.sample_rate
            )));
        }
        _ => match Waveform::of(codec) {
            Some(form @ (Waveform::S16 | Waveform::S24 | Waveform::S32)) => {
                waveform_entry(&mut entry, b"ipcm", packets, form);
            }
            Some(Waveform::F32) => waveform_entry(&mut entry, b"fpcm", packets, Waveform::F32),
            _ => {
                let what = "MP4 has no name for this kind of sound: AAC, Opus, FLAC, MP3 and PCM of 16 bits or more are taken";
                return Err(Mp4Error::Unsupported(what.to_owned()));
            }
        },
    }
    Ok(entry)
}

/// Bytes of the one FLAC block that a decoder needs (RFC 9639, 8.2).
const STREAMINFO_BYTES: usize = 34;

fn waveform_entry(entry: &mut Vec<u8>, kind: &[u8; 4], packets: &Packets, form: Waveform) {
    let bits = 8 * form.bytes() as u8;
    write_box(entry, kind, |out| {
        put(out, &audio(packets, bits.into()));
        put(out, &PcmC { big_endian: false, sample_size: bits });
    });
}

fn audio(packets: &Packets, bits: u16) -> Audio {
    // A rate that the field cannot hold is told by the timescale alone.
    let sample_rate = u16::try_from(packets.sample_rate).unwrap_or(0).into();
    Audio { data_reference_index: 1, channel_count: packets.channels, sample_size: bits, sample_rate }
}

/// The sample entry of Opus from the header of an Ogg stream (RFC 7845, 5.1).
pub(crate) fn opus_entry(head: &[u8]) -> Result<Opus, Mp4Error> {
    let wrong = || Mp4Error::Unsupported("the header of the Opus sound is broken".to_owned());
    let ([b'O', b'p', b'u', b's', b'H', b'e', b'a', b'd', _version, channels], fields) =
        head.split_first_chunk().ok_or_else(wrong)?
    else {
        return Err(wrong());
    };
    let [skip0, skip1, rate0, rate1, rate2, rate3, gain0, gain1, family, table @ ..] = fields else {
        return Err(wrong());
    };
    let channel_mapping = match (family, table) {
        (0, _) => None,
        (family, [streams, coupled, mapping @ ..]) if mapping.len() >= usize::from(*channels) => {
            Some(mp4_atom::OpusChannelMapping {
                family: *family,
                stream_count: *streams,
                coupled_count: *coupled,
                channel_mapping: mapping[..usize::from(*channels)].to_vec(),
            })
        }
        _ => return Err(wrong()),
    };
    let dops = mp4_atom::Dops {
        output_channel_count: *channels,
        pre_skip: u16::from_le_bytes([*skip0, *skip1]),
        input_sample_rate: u32::from_le_bytes([*rate0, *rate1, *rate2, *rate3]),
        output_gain: i16::from_le_bytes([*gain0, *gain1]),
        channel_mapping,
    };
    mp4_atom::Encode::encode(&dops, &mut Vec::new()).map_err(|_| wrong())?;
    Ok(crate::opus::sample_entry(dops))
}
