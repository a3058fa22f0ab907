//! Waveforms coded with Opus (RFC 6716), at 48 kHz.

use crate::boxes::put;
use crate::sound::{Packets, Waveform};
use crate::{Mp4Error, SampleSource, SourceSample, TrackDescription, TrackKind};
use mp4_atom::{Audio, Dops, Opus};
use ropus::{Application, Bitrate, Channels, Encoder};
use rubato::audioadapter_buffers::direct::InterleavedSlice;
use rubato::{Async, FixedAsync, Indexing, Resampler, SincInterpolationParameters};
use std::collections::VecDeque;
use std::ops::RangeInclusive;

/// Sound frames a second that Opus works with.
const RATE: u32 = 48_000;
/// Sound frames of a packet: 20 ms.
const FRAME: usize = 960;
/// Sound frames that are resampled at a time.
const CHUNK: usize = 1024;
/// Most bytes of a packet (RFC 6716, 3.4, and room for its lengths).
const MOST_BYTES: usize = 4000;
/// Rates that are accepted.
const LEAST_BITS: u32 = 6_000;
const MOST_BITS: u32 = 510_000;
/// Sample rates that are resampled, in Hz: the filter takes memory by the rate.
pub(crate) const SAMPLE_RATES: RangeInclusive<u32> = 4_000..=384_000;

/// The sample entry of Opus, in which all sound has 48 kHz and 16 bits.
pub(crate) fn sample_entry(dops: Dops) -> Opus {
    let audio = Audio {
        data_reference_index: 1,
        channel_count: dops.output_channel_count.into(),
        sample_size: 16,
        sample_rate: (RATE as u16).into(),
    };
    Opus { audio, dops, btrt: None }
}

/// A waveform, coded as it is read.
pub(crate) struct OpusSource {
    packets: Packets,
    form: Waveform,
    description: TrackDescription,
    encoder: Encoder,
    channels: usize,
    resampler: Option<Resampling>,
    /// Numbers at 48 kHz that wait for a whole packet, channels beside each other.
    waiting: VecDeque<f32>,
    /// Sound frames at 48 kHz that came in, and that went out.
    frames_in: u64,
    frames_out: u64,
    ended: bool,
    delay: u64,
}

/// A change of sample rate.
struct Resampling {
    resampler: Async<f32>,
    /// Numbers at the rate of the file.
    waiting: Vec<f32>,
    /// Sound frames that the resampler's filter gives before the first.
    skip: usize,
    /// Sound frames that came in, and at 48 kHz that went out.
    frames_in: u64,
    frames_out: u64,
    rate: u32,
}

impl OpusSource {
    /// Codes the packets, which hold numbers of this form, at so many bits a second.
    pub(crate) fn new(packets: Packets, form: Waveform, bits_per_second: u32) -> Result<Self, Mp4Error> {
        let channels = match packets.channels {
            1 => Channels::Mono,
            2 => Channels::Stereo,
            more => {
                let what = format!(
                    "waveforms of 1 or 2 channels are coded, not of {more}: code them first, or take them as they are"
                );
                return Err(Mp4Error::Unsupported(what));
            }
        };
        if !(LEAST_BITS..=MOST_BITS).contains(&bits_per_second) {
            let what = format!("Opus has {LEAST_BITS} to {MOST_BITS} bits a second, not {bits_per_second}");
            return Err(Mp4Error::Unsupported(what));
        }
        if !SAMPLE_RATES.contains(&packets.sample_rate) {
            let (least, most) = (SAMPLE_RATES.start(), SAMPLE_RATES.end());
            let what = format!(
                "waveforms of {least} to {most} Hz are coded, not of {} Hz: resample them first",
                packets.sample_rate
            );
            return Err(Mp4Error::Unsupported(what));
        }
        let encoder = Encoder::builder(RATE, channels, Application::Audio)
            .bitrate(Bitrate::Bits(bits_per_second))
            .build()
            .map_err(|error| Mp4Error::Unsupported(format!("Opus: {error}")))?;
        let delay = encoder.lookahead();
        let channels = usize::from(packets.channels);
        let mut entry = Vec::new();
        let dops = Dops {
            output_channel_count: channels as u8,
            pre_skip: delay as u16,
            input_sample_rate: packets.sample_rate,
            output_gain: 0,
            channel_mapping: None,
        };
        put(&mut entry, &sample_entry(dops));
        let mut description = TrackDescription::new(TrackKind::Sound, RATE, entry);
        description.edit.media_time = delay.into();
        let resampler = match packets.sample_rate {
            RATE => None,
            rate => Some(Resampling::new(rate, channels)?),
        };
        Ok(Self {
            packets,
            form,
            description,
            encoder,
            channels,
            resampler,
            waiting: VecDeque::new(),
            frames_in: 0,
            frames_out: 0,
            ended: false,
            delay: delay.into(),
        })
    }

    /// Reads until a packet can be coded, or the file ends.
    fn fill(&mut self) -> Result<(), Mp4Error> {
        while !self.ended && self.waiting.len() < FRAME * self.channels {
            let before = self.waiting.len();
            match self.packets.next()? {
                Some((data, _)) => {
                    let numbers = self.form.numbers(&data);
                    match &mut self.resampler {
                        Some(resampler) => resampler.push(numbers, self.channels, &mut self.waiting)?,
                        None => self.waiting.extend(numbers),
                    }
                }
                None => {
                    self.ended = true;
                    if let Some(resampler) = &mut self.resampler {
                        resampler.finish(self.channels, &mut self.waiting)?;
                    }
                }
            }
            self.frames_in += ((self.waiting.len() - before) / self.channels) as u64;
        }
        Ok(())
    }
}

impl SampleSource for OpusSource {
    fn description(&self) -> &TrackDescription {
        &self.description
    }

    fn next_sample(&mut self) -> Result<Option<SourceSample>, Mp4Error> {
        self.fill()?;
        // What the encoder holds back comes out behind silence.
        if self.ended && self.frames_out >= self.frames_in + self.delay {
            return Ok(None);
        }
        let count = (FRAME * self.channels).min(self.waiting.len());
        let mut numbers: Vec<f32> = self.waiting.drain(..count).collect();
        numbers.resize(FRAME * self.channels, 0.0);
        let mut data = vec![0; MOST_BYTES];
        let bytes = self
            .encoder
            .encode_float(&numbers, &mut data)
            .map_err(|error| Mp4Error::Unsupported(format!("Opus: {error}")))?;
        data.truncate(bytes);
        let time = self.frames_out;
        self.frames_out += FRAME as u64;
        Ok(Some(SourceSample { time, duration: FRAME as u32, composition_offset: 0, sync: true, data }))
    }
}

impl Resampling {
    fn new(rate: u32, channels: usize) -> Result<Self, Mp4Error> {
        // The other resampler, by Fourier transforms, takes this crate four times as long to compile.
        let ratio = f64::from(RATE) / f64::from(rate);
        let filter = SincInterpolationParameters::default();
        let resampler = Async::new_sinc(ratio, 1.0, &filter, CHUNK, channels, FixedAsync::Input)
            .map_err(|error| Mp4Error::Unsupported(format!("sound of {rate} Hz: {error}")))?;
        let skip = resampler.output_delay();
        Ok(Self { resampler, waiting: Vec::new(), skip, frames_in: 0, frames_out: 0, rate })
    }

    /// Takes numbers, and gives what is whole of them at 48 kHz.
    fn push(
        &mut self,
        numbers: impl Iterator<Item = f32>,
        channels: usize,
        out: &mut VecDeque<f32>,
    ) -> Result<(), Mp4Error> {
        let before = self.waiting.len();
        self.waiting.extend(numbers);
        self.frames_in += ((self.waiting.len() - before) / channels) as u64;
        loop {
            let chunk = self.resampler.input_frames_next();
            if self.waiting.len() < chunk * channels {
                return Ok(());
            }
            self.chunk(chunk, channels, out)?;
        }
    }

    /// Gives the rest, as much as belongs to what came in.
    fn finish(&mut self, channels: usize, out: &mut VecDeque<f32>) -> Result<(), Mp4Error> {
        let expected = (self.frames_in * u64::from(RATE)).div_ceil(u64::from(self.rate));
        self.chunk(self.waiting.len() / channels, channels, out)?;
        // What the filter still holds comes out behind silence.
        while self.frames_out < expected {
            self.chunk(0, channels, out)?;
        }
        let excess = (self.frames_out - expected) as usize * channels;
        out.truncate(out.len().saturating_sub(excess));
        Ok(())
    }

    fn chunk(&mut self, frames: usize, channels: usize, out: &mut VecDeque<f32>) -> Result<(), Mp4Error> {
        let failed = |error: &dyn std::fmt::Display| {
            Mp4Error::Unsupported(format!("sound cannot be resampled: {error}"))
        };
        let mut numbers: Vec<f32> = self.waiting.drain(..frames * channels).collect();
        let whole = self.resampler.input_frames_next();
        numbers.resize(whole * channels, 0.0);
        let input = InterleavedSlice::new(&numbers, channels, whole).map_err(|error| failed(&error))?;
        let partial_len = (frames < whole).then_some(frames);
        let indexing =
            Indexing { input_offset: 0, output_offset: 0, partial_len, active_channels_mask: None };
        let resampled =
            self.resampler.process(&input, Some(&indexing)).map_err(|error| failed(&error))?.take_data();
        let skipped = self.skip.min(resampled.len() / channels);
        self.skip -= skipped;
        self.frames_out += (resampled.len() / channels - skipped) as u64;
        out.extend(&resampled[skipped * channels..]);
        Ok(())
    }
}
