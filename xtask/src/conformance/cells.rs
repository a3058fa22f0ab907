//! Streams of version 2 whose masks are coded by cell.

use super::extremes::judged;
use super::main_profile::foreign;
use super::raw::{RawFrame, RawStream, judge};
use super::{Stream, encode, header};
use anyhow::{Context, Result};
use isv::raw::encode::{Band, Encoder, EncoderSettings, MainSettings, Refresh};
use isv::raw::format::{ColourLayers, MaskCoding, Profile, StreamHeader};
use isv::raw::volume::SparseVolume;
use isv_testkit::{Random, ball, still_and_moving_ball};

/// All of them, by name.
pub(super) fn streams() -> Result<Vec<(&'static str, Stream)>> {
    let usual = MainSettings::default();
    let whole = MainSettings { band: Band::Full, ..usual };
    let gradual = MainSettings { refresh: Refresh::Gradual, ..usual };
    let balls = |frames: u32| move |header: &StreamHeader| moving(header, frames);
    Ok(vec![
        ("version_2_cells", encoded(8, usual, (4, 1), balls(4))?),
        ("version_2_cells_whole_band", encoded(4, whole, (3, 3), balls(4))?),
        ("version_2_cells_settled", encoded(8, usual, (6, 1), still_and_moving)?),
        ("version_2_cells_resilient", encoded(8, gradual, (3, 2), balls(5))?),
        ("version_2_cells_noise", noise()?),
        ("version_2_cells_border_no_index", foreign(include_bytes!("cells_border.isv"))?),
        (
            "version_2_cells_without_prediction_no_index",
            foreign(include_bytes!("cells_without_prediction.isv"))?,
        ),
    ])
}

/// The header of a stream whose masks are coded by cell.
pub(super) fn by_cell(header: StreamHeader) -> StreamHeader {
    header.with_mask_coding(MaskCoding::Cells)
}

/// A stream of volumes, in groups of so many frames, each in so many slices.
fn encoded(
    truncation: u32,
    main: MainSettings,
    (gop, slices): (u32, u16),
    volumes: impl Fn(&StreamHeader) -> Vec<SparseVolume>,
) -> Result<Stream> {
    let header = by_cell(header(Profile::Main, 8, truncation)?);
    let settings = EncoderSettings { gop, slices: Some(slices), main, ..Default::default() };
    encode(&header, settings, &volumes(&header))
}

/// The moving ball with its hole.
fn moving(header: &StreamHeader, frames: u32) -> Vec<SparseVolume> {
    (0..frames).map(|frame| ball(header.grid, f64::from(frame))).collect()
}

/// A ball with a hole that stays and another one that passes by, stops and goes on.
fn still_and_moving(header: &StreamHeader) -> Vec<SparseVolume> {
    [0.0, 1.0, 2.0, 2.0, 4.0].map(|t| still_and_moving_ball(header.grid, t)).into()
}

/// Frames of the moving ball whose cells are drawn at random, of a stream that may have colour.
fn noise() -> Result<Stream> {
    let header = by_cell(header(Profile::Main, 8, 8)?).with_colour(ColourLayers::Voxels);
    let mut encoder = Encoder::new(&header, EncoderSettings::default());
    let mut random = Random::new(21);
    let mut stream = RawStream::new(&header);
    for volume in moving(&header, 3) {
        let coded = encoder.encode(&volume);
        let mut payload = RawFrame::from(&coded.payload());
        stream = (0..400)
            .find_map(|_| {
                payload.masks = (0..4000).map(|_| (random.signed() * 128.0) as i8 as u8).collect();
                // The first bit says that there are some.
                payload.masks[0] &= 0x3f;
                let mut longer = stream.clone();
                longer.frame(coded.keyframe, 0, false, &payload.to_bytes());
                judge(&longer.bytes).1.is_none().then_some(longer)
            })
            .context("random cells that decode")?;
    }
    judged(stream.finish())
}
