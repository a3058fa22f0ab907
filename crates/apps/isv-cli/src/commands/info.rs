//! `isv info`: what a stream says about itself.

use crate::failure::one_line;
use crate::output::{frames_in_words, print, say};
use crate::stream;
use anyhow::{Result, bail};
use comfy_table::{Table, presets};
use isv::raw::format::MaskCoding;
use isv::raw::mp4::is_other_end;
use isv::raw::take::metadata::Metadata;
use isv::raw::take::stream::{PacketInfo, PaperInfo, StreamInfo, TrackSummary};
use isv::raw::take::{Input, Length};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Describe .isv and MP4 files
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The files. After one that cannot be read, the others are described too
    #[arg(value_name = "IN.isv", required = true)]
    inputs: Vec<PathBuf>,
    /// Print JSON, with every packet
    ///
    /// An object, or a list of objects for several files.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<()> {
    if let [input] = args.inputs.as_slice() {
        let info = read(input)?;
        return print(&if args.json { serde_json::to_string_pretty(&info)? } else { table(&info) });
    }
    let mut descriptions = Vec::new();
    for input in &args.inputs {
        let file = stream::name(input);
        let description = match read(input) {
            Ok(info) => Description { file, info: Some(info), error: None },
            Err(error) => Description { file, info: None, error: Some(one_line(&format!("{error:#}"))) },
        };
        if !args.json {
            description.print()?;
        }
        descriptions.push(description);
    }
    if args.json {
        print(&serde_json::to_string_pretty(&descriptions)?)?;
    }
    let failed: Vec<_> = descriptions.iter().filter(|d| d.error.is_some()).map(|d| d.file.as_str()).collect();
    match failed.as_slice() {
        [] => Ok(()),
        failed => {
            bail!("{} of {} files cannot be read: {}", failed.len(), descriptions.len(), failed.join(", "))
        }
    }
}

fn read(input: &Path) -> Result<StreamInfo> {
    StreamInfo::read(&Input::from_argument(input)).map_err(|error| stream::advise_repair(error.into()))
}

/// One of several files: its name with the keys of [`StreamInfo`], or with what is wrong with it.
#[derive(Debug, Serialize)]
struct Description {
    file: String,
    #[serde(flatten)]
    info: Option<StreamInfo>,
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<String>,
}

impl Description {
    fn print(&self) -> Result<()> {
        match (&self.info, &self.error) {
            (Some(info), _) => print(&format!("{}\n{}\n", self.file, table(info))),
            (None, error) => {
                say(format_args!("isv: {}", error.as_deref().unwrap_or_default()));
                Ok(())
            }
        }
    }
}

fn table(info: &StreamInfo) -> String {
    let length = |metres| Length::from_metres(metres).to_string();
    let mut table = Table::new();
    table.load_style(presets::NOTHING);
    let mut row = |name: &str, value: String| {
        table.add_row([name, &value]);
    };
    let masks = if info.masks == MaskCoding::Cells.name() { ", masks by cell" } else { "" };
    row("format", format!("version {}, profile {}{masks}", info.format_version, info.profile));
    row("frames", format!("{} at {} a second, {:.2} s", info.frames, info.fps, info.duration_s));
    row("bytes", format!("{}, {:.3} Mbps", info.bytes, info.bitrate_mbps));
    row(
        "grid",
        format!(
            "voxels of {}, blocks of {}^3, truncation {} voxels",
            length(info.voxel_size_m),
            info.block_edge,
            info.truncation_voxels
        ),
    );
    if let Some(PaperInfo { coefficients, dc_step_mm, ac_step_mm, .. }) = info.paper {
        let [dc_step, ac_step] = [dc_step_mm, ac_step_mm].map(|step_mm| length(step_mm / 1e3));
        row("quantizer", format!("{coefficients} coefficients, DC step {dc_step}, AC step {ac_step}"));
    }
    for (kind, packets) in packets_by_kind(info) {
        let bytes = packets.iter().map(|p| p.bytes).sum::<usize>() / packets.len();
        let blocks = packets.iter().map(|p| p.blocks as usize).sum::<usize>() / packets.len();
        row(
            &kind,
            format!("{}, on average {bytes} bytes and {blocks} blocks", frames_in_words(packets.len())),
        );
    }
    for track in &info.tracks {
        let TrackSummary { kind, codec, samples, end_s, longer_s, bytes, .. } = track;
        let other = match is_other_end(*longer_s, 1.0 / info.fps) {
            true if *longer_s > 0.0 => format!(" ({longer_s:.2} s longer than the geometry)"),
            true => format!(" ({:.2} s shorter than the geometry)", -longer_s),
            false => String::new(),
        };
        row(kind, format!("{codec}, {samples} samples, {end_s:.2} s{other}, {bytes} bytes"));
    }
    if info.colour_layers > 0 {
        row("colour", colour_in_words(info));
    }
    if let Some(metadata) = &info.metadata {
        for (name, value) in metadata_rows(metadata) {
            row(name, value);
        }
    }
    if info.unknown_packets > 0 {
        row("unknown", format!("{} packets of types that only a newer isv knows", info.unknown_packets));
    }
    if !info.complete {
        row("end", "missing: the file has no index or no trailer, so frames may be missing too".to_owned());
    }
    if info.bytes_behind > 0 {
        row("behind", format!("{} bytes that are no part of the stream", info.bytes_behind));
    }
    table.trim_fmt()
}

/// What a stream says of itself, a row each.
fn metadata_rows(metadata: &Metadata) -> Vec<(&'static str, String)> {
    let mut rows = Vec::new();
    let mut row = |name, value: Option<String>| rows.extend(value.map(|value| (name, printable(&value))));
    row("title", metadata.title.clone());
    row("device", metadata.device.clone());
    let axis = |up: &String| format!("{up} up");
    let place = |[x, y, z]: [f64; 3]| format!("origin at {x}, {y}, {z} m of the capture");
    let parts = [metadata.unit.clone(), metadata.up.as_ref().map(axis), metadata.origin.map(place)];
    let parts: Vec<_> = parts.into_iter().flatten().chain(metadata.colour_space.clone()).collect();
    row("space", (!parts.is_empty()).then(|| parts.join(", ")));
    row("source", metadata.source.as_ref().map(|source| format!("{}, {} up", source.unit, source.up)));
    row(
        "surface",
        metadata.surface.as_ref().map(|surface| match surface.shell_mm {
            Some(mm) => format!("{}, shell {mm} mm thick", surface.sign),
            None => surface.sign.clone(),
        }),
    );
    let settings = metadata.settings.iter().map(|(key, value)| match value {
        serde_json::Value::String(text) => format!("{key} {text}"),
        other => format!("{key} {other}"),
    });
    let made = metadata.encoder.iter().cloned().chain(settings).collect::<Vec<_>>();
    row("encoder", (!made.is_empty()).then(|| made.join(", ")));
    rows
}

/// A text of a stream, which must not move the cursor of a terminal.
fn printable(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

/// Layers, and what part of the bytes is for colour.
fn colour_in_words(info: &StreamInfo) -> String {
    let layers = match info.colour_layers {
        1 => "1 layer".to_owned(),
        layers => format!("{layers} layers"),
    };
    format!("{layers}, {} bytes; geometry {} bytes", info.bytes_colour, info.bytes_geometry)
}

/// The packets of each kind that occurs.
fn packets_by_kind(info: &StreamInfo) -> Vec<(String, Vec<&PacketInfo>)> {
    let mut kinds: Vec<(String, Vec<&PacketInfo>)> = Vec::new();
    for packet in &info.packets {
        let kind = kind_in_words(packet);
        match kinds.iter_mut().find(|(name, _)| *name == kind) {
            Some((_, packets)) => packets.push(packet),
            None => kinds.push((kind, vec![packet])),
        }
    }
    kinds
}

/// The name of a packet's kind among others.
fn kind_in_words(packet: &PacketInfo) -> String {
    match packet {
        PacketInfo { keyframe: true, .. } => "keyframes".to_owned(),
        PacketInfo { resilient: true, prediction, .. } => format!("resilient, motion {prediction}"),
        PacketInfo { prediction, .. } => format!("motion {prediction}"),
    }
}
