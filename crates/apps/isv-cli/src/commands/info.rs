//! `isv info`: what a stream says about itself.

use crate::cli_enums;
use crate::failure::one_line;
use crate::output::{frames_in_words, print, say};
use crate::stream;
use anyhow::{Result, bail};
use comfy_table::{Table, presets};
use isv::raw::format::{PaperParameters, Profile, StreamHeader};
use isv::raw::kernels::quant::STEP_FRACTION_BITS;
use isv::raw::take::stream::{PacketSummary, StreamSummary};
use isv::raw::take::{Input, Length};
use isv::raw::volume::CODES_PER_VOXEL;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Describe .isv files
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

/// The names of the fields are the keys of `isv info --json`.
#[derive(Debug, Serialize)]
struct StreamInfo {
    format_version: u16,
    /// How many layers of colour samples frames may have.
    colour_layers: u8,
    profile: &'static str,
    frames: usize,
    fps: f64,
    voxel_size_m: f64,
    truncation_voxels: u32,
    block_edge: usize,
    #[serde(flatten)]
    paper: Option<PaperInfo>,
    /// From when the first frame is shown, by timestamps.
    duration_s: f64,
    /// The whole file.
    bytes: u64,
    /// The geometry parts of all frames.
    bytes_geometry: usize,
    /// The colour parts of all frames, without their lengths.
    bytes_colour: usize,
    bitrate_mbps: f64,
    /// Whether index and trailer are there, with which a writer ends.
    complete: bool,
    /// Bytes of the file behind its end, where there should be none.
    bytes_behind: u64,
    /// Packets whose types are not known and may be skipped.
    unknown_packets: usize,
    /// Frame numbers.
    keyframes: Vec<usize>,
    packets: Vec<PacketInfo>,
}

/// What only profile `paper` states for a whole stream.
#[derive(Debug, Serialize)]
struct PaperInfo {
    coefficients: u16,
    dc_step_mm: f64,
    ac_step_mm: f64,
}

#[derive(Debug, Serialize)]
struct PacketInfo {
    /// Header and payload.
    bytes: usize,
    /// The geometry part of the payload.
    bytes_geometry: usize,
    /// The colour part of the payload, without its length.
    bytes_colour: usize,
    keyframe: bool,
    blocks: u32,
    prediction: &'static str,
    /// Whether a decoder that lost something can go on here, though it is no keyframe.
    resilient: bool,
    timestamp_ns: u64,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<()> {
    if let [input] = args.inputs.as_slice() {
        let info = StreamInfo::read(input).map_err(stream::advise_repair)?;
        return print(&if args.json { serde_json::to_string_pretty(&info)? } else { info.table() });
    }
    let mut descriptions = Vec::new();
    for input in &args.inputs {
        let file = stream::name(input);
        let description = match StreamInfo::read(input).map_err(stream::advise_repair) {
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
            (Some(info), _) => print(&format!("{}\n{}\n", self.file, info.table())),
            (None, error) => {
                say(format_args!("isv: {}", error.as_deref().unwrap_or_default()));
                Ok(())
            }
        }
    }
}

impl StreamInfo {
    fn read(path: &Path) -> Result<Self> {
        let summary = StreamSummary::read(&Input::from_argument(path))?;
        let (header, packets) = (&summary.header, &summary.packets);
        let keyframes = packets.iter().enumerate().filter(|(_, p)| p.keyframe).map(|(frame, _)| frame);
        Ok(Self {
            format_version: header.version.number(),
            colour_layers: header.colour_layers.count(),
            profile: header.profile.name(),
            frames: packets.len(),
            fps: header.frame_rate.per_second(),
            voxel_size_m: header.grid.voxel_size.metres(),
            truncation_voxels: header.grid.truncation.voxels(),
            block_edge: header.grid.edge.voxels(),
            paper: PaperInfo::new(header),
            bytes: summary.bytes,
            bytes_geometry: packets.iter().map(|packet| packet.bytes_geometry).sum(),
            bytes_colour: packets.iter().map(|packet| packet.bytes_colour).sum(),
            duration_s: summary.duration_s,
            bitrate_mbps: summary.mbps(),
            complete: summary.is_complete,
            bytes_behind: summary.bytes_behind,
            unknown_packets: summary.unknown_packets,
            keyframes: keyframes.collect(),
            packets: packets.iter().map(PacketInfo::new).collect(),
        })
    }

    fn table(&self) -> String {
        let length = |metres| Length::from_metres(metres).to_string();
        let mut table = Table::new();
        table.load_style(presets::NOTHING);
        let mut row = |name: &str, value: String| {
            table.add_row([name, &value]);
        };
        row("format", format!("version {}, profile {}", self.format_version, self.profile));
        row("frames", format!("{} at {} a second, {:.2} s", self.frames, self.fps, self.duration_s));
        row("bytes", format!("{}, {:.3} Mbps", self.bytes, self.bitrate_mbps));
        row(
            "grid",
            format!(
                "voxels of {}, blocks of {}^3, truncation {} voxels",
                length(self.voxel_size_m),
                self.block_edge,
                self.truncation_voxels
            ),
        );
        if let Some(PaperInfo { coefficients, dc_step_mm, ac_step_mm }) = self.paper {
            let [dc_step, ac_step] = [dc_step_mm, ac_step_mm].map(|step_mm| length(step_mm / 1e3));
            row("quantizer", format!("{coefficients} coefficients, DC step {dc_step}, AC step {ac_step}"));
        }
        for (kind, packets) in self.packets_by_kind() {
            let bytes = packets.iter().map(|p| p.bytes).sum::<usize>() / packets.len();
            let blocks = packets.iter().map(|p| p.blocks as usize).sum::<usize>() / packets.len();
            row(
                &kind,
                format!("{}, on average {bytes} bytes and {blocks} blocks", frames_in_words(packets.len())),
            );
        }
        if self.colour_layers > 0 {
            row("colour", self.colour_in_words());
        }
        if self.unknown_packets > 0 {
            row("unknown", format!("{} packets of types that only a newer isv knows", self.unknown_packets));
        }
        if !self.complete {
            row(
                "end",
                "missing: the file has no index or no trailer, so frames may be missing too".to_owned(),
            );
        }
        if self.bytes_behind > 0 {
            row("behind", format!("{} bytes that are no part of the stream", self.bytes_behind));
        }
        table.trim_fmt()
    }

    /// Layers, and what part of the bytes is for colour.
    fn colour_in_words(&self) -> String {
        let layers = match self.colour_layers {
            1 => "1 layer".to_owned(),
            layers => format!("{layers} layers"),
        };
        format!("{layers}, {} bytes; geometry {} bytes", self.bytes_colour, self.bytes_geometry)
    }

    /// The packets of each kind that occurs.
    fn packets_by_kind(&self) -> Vec<(String, Vec<&PacketInfo>)> {
        let mut kinds: Vec<(String, Vec<&PacketInfo>)> = Vec::new();
        for packet in &self.packets {
            let kind = packet.kind();
            match kinds.iter_mut().find(|(name, _)| *name == kind) {
                Some((_, packets)) => packets.push(packet),
                None => kinds.push((kind, vec![packet])),
            }
        }
        kinds
    }
}

impl PaperInfo {
    fn new(header: &StreamHeader) -> Option<Self> {
        let Profile::Paper(PaperParameters { coefficients, dc_step, ac_step }) = header.profile else {
            return None;
        };
        let [dc_step_mm, ac_step_mm] = [dc_step, ac_step].map(|step| step_mm(header, step));
        Some(Self { coefficients, dc_step_mm, ac_step_mm })
    }
}

impl PacketInfo {
    fn new(packet: &PacketSummary) -> Self {
        Self {
            bytes: packet.bytes,
            bytes_geometry: packet.bytes_geometry,
            bytes_colour: packet.bytes_colour,
            keyframe: packet.keyframe,
            blocks: packet.blocks,
            prediction: cli_enums::prediction(packet.prediction),
            resilient: packet.resilient,
            timestamp_ns: packet.timestamp_ns,
        }
    }

    /// What it is called among others.
    fn kind(&self) -> String {
        match self {
            Self { keyframe: true, .. } => "keyframes".to_owned(),
            Self { resilient: true, prediction, .. } => format!("resilient, motion {prediction}"),
            Self { prediction, .. } => format!("motion {prediction}"),
        }
    }
}

/// A step of a stream's header, which is in sixteenths of a code, in millimetres.
fn step_mm(header: &StreamHeader, step: u32) -> f64 {
    f64::from(step) / f64::from(CODES_PER_VOXEL << STEP_FRACTION_BITS) * header.grid.voxel_size.metres() * 1e3
}
