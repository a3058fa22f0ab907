//! Options of encoding from Python's names.

use isv::raw::take::FrameRange;
use isv::{
    BitRate, EncodeOptions, Length, MetadataChoice, Preset, Refresh, SignMode, TimestampSource, Unit, Up,
};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Options of encoding, and the place of frames that come as arrays.
pub(crate) struct Options {
    pub(crate) encode: EncodeOptions,
    pub(crate) placement: Option<Placement>,
}

/// Change of coordinates from a user's meshes and points to those of a stream: metres, Y up.
#[derive(Clone, Copy)]
pub(crate) struct Placement {
    metres: f64,
    origin_m: [f64; 3],
    up: Up,
}

impl Placement {
    pub(crate) fn point(&self, point: [f64; 3]) -> [f32; 3] {
        let moved = std::array::from_fn(|axis| point[axis] * self.metres - self.origin_m[axis]);
        self.direction(moved)
    }

    pub(crate) fn direction(&self, direction: [f64; 3]) -> [f32; 3] {
        self.up.to_y_up().mul_vec3(direction.into()).as_vec3().to_array()
    }
}

impl Options {
    /// Reads options from a dictionary of those that were given.
    pub(crate) fn read(given: &Bound<'_, PyDict>) -> PyResult<Self> {
        let mut encode = target(given)?;
        let (mut unit, mut origin, mut up) = (None, None, None);
        for (name, value) in given {
            let name: String = name.extract()?;
            let number = || value.extract::<f64>();
            let choice = || value.extract::<String>();
            encode = match name.as_str() {
                "quality" | "bitrate_mbps" | "max_error" => encode,
                "color_quality" => encode.colour_quality(number()? as f32),
                "color" if value.extract()? => encode,
                "color" => encode.without_colour(),
                "two_passes" if value.extract()? => encode.two_passes(),
                "preset" => encode.preset(pick(
                    &name,
                    &choice()?,
                    &[
                        ("realtime", Preset::Realtime),
                        ("balanced", Preset::Balanced),
                        ("archive", Preset::Archive),
                    ],
                )?),
                "refresh" => encode.refresh(pick(
                    &name,
                    &choice()?,
                    &[("keyframes", Refresh::Keyframes), ("gradual", Refresh::Gradual)],
                )?),
                "voxel" => match choice().ok() {
                    Some(word) => pick(&name, &word, &[("auto", encode.voxel_by_trial())])?,
                    None => encode.voxel(length(&name, number()?)?),
                },
                "fps" => encode.fps(number()?),
                "gop" => encode.gop(count(&name, &value)?),
                "fixed_gop" => encode.fixed_gop(value.extract()?),
                "time_origin" => encode.time_origin(value.extract()?),
                "expect_color" if value.extract()? => encode.expect_colour(),
                "full_band" if value.extract()? => encode.full_band(),
                "profile" => pick(
                    &name,
                    &choice()?,
                    &[("main", encode.clone()), ("paper", encode.clone().as_in_paper())],
                )?,
                "checksums" => encode.checksums(value.extract()?),
                "title" => encode.title(value.extract::<String>()?),
                "capture_device" => encode.capture_device(value.extract::<String>()?),
                "metadata" => encode.metadata(pick(
                    &name,
                    &choice()?,
                    &[
                        ("auto", MetadataChoice::Auto),
                        ("always", MetadataChoice::Always),
                        ("never", MetadataChoice::Never),
                    ],
                )?),
                "timestamps" => encode.timestamps(pick(
                    &name,
                    &choice()?,
                    &[
                        ("source", TimestampSource::Source),
                        ("rate", TimestampSource::Rate),
                        ("clock", TimestampSource::Clock),
                    ],
                )?),
                "sign" => encode.sign(pick(
                    &name,
                    &choice()?,
                    &[
                        ("auto", SignMode::Auto),
                        ("closed", SignMode::Closed),
                        ("offset", SignMode::Offset),
                        ("sheet", SignMode::Sheet),
                    ],
                )?),
                "shell_offset" => encode.shell_offset(number()?),
                "estimate_normals" if value.extract()? => encode.estimate_normals(),
                "viewpoint" => encode.viewpoint(place(&name, &value)?),
                "accumulate_depth" if value.extract()? => encode.accumulate_depth(),
                "max_depth" => encode.max_depth(length(&name, number()?)?),
                "max_blocks" => encode.max_blocks(count(&name, &value)? as usize),
                "units" => {
                    let parsed = choice()?.parse::<Unit>();
                    let found = parsed.map_err(|why| PyValueError::new_err(format!("units: {why}")))?;
                    unit = Some(found);
                    encode.units(found)
                }
                "origin" => {
                    let found = place(&name, &value)?;
                    origin = Some(found);
                    encode.origin(found)
                }
                "up" => {
                    let axes = Up::ALL.map(|axis| (axis.name(), axis));
                    let found = pick(&name, &choice()?, &axes)?;
                    up = Some(found);
                    encode.up(found)
                }
                "frames" => {
                    let (start, stop) = value.extract::<(usize, Option<usize>)>()?;
                    encode.frames(start..stop.unwrap_or(FrameRange::OPEN))
                }
                "animation" => encode.animation(choice()?),
                "skip_bad_frames" => encode.skip_bad_frames(value.extract()?),
                "drop_invalid_points" => encode.drop_invalid_points(value.extract()?),
                "memory_limit" => encode.memory_limit(value.extract()?),
                // Flags that are off.
                "two_passes" | "full_band" | "expect_color" | "estimate_normals" | "accumulate_depth" => {
                    encode
                }
                _ => return Err(PyTypeError::new_err(format!("{name} is no option of encoding"))),
            };
        }
        let placement = (unit.is_some() || origin.is_some() || up.is_some()).then(|| {
            let metres = unit.unwrap_or(Unit::Metre).metres();
            let origin_m = origin.unwrap_or_default().map(|coordinate| coordinate * metres);
            Placement { metres, origin_m, up: up.unwrap_or(Up::Y) }
        });
        Ok(Self { encode, placement })
    }
}

/// The options of the one target that was given, or the defaults.
fn target(given: &Bound<'_, PyDict>) -> PyResult<EncodeOptions> {
    let number = |name| {
        Ok::<_, PyErr>(match given.get_item(name)? {
            Some(value) => Some(value.extract::<f64>()?),
            None => None,
        })
    };
    match (number("quality")?, number("bitrate_mbps")?, number("max_error")?) {
        (None, None, None) => Ok(EncodeOptions::new()),
        (Some(quality), None, None) => Ok(EncodeOptions::quality(quality as f32)),
        (None, Some(mbps), None) => Ok(EncodeOptions::bitrate(BitRate::from_bits_per_second(mbps * 1e6))),
        (None, None, Some(error)) => Ok(EncodeOptions::max_error(Length::from_metres(error))),
        _ => Err(PyValueError::new_err("quality, bitrate_mbps and max_error exclude each other")),
    }
}

fn pick<T: Clone>(name: &str, asked: &str, choices: &[(&str, T)]) -> PyResult<T> {
    let found = choices.iter().find(|(choice, _)| *choice == asked);
    found.map(|(_, value)| value.clone()).ok_or_else(|| {
        let choices: Vec<_> = choices.iter().map(|(choice, _)| format!("{choice:?}")).collect();
        PyValueError::new_err(format!("{name} is {}, not {asked:?}", choices.join(" or ")))
    })
}

fn length(name: &str, metres: f64) -> PyResult<Length> {
    match metres > 0.0 && metres.is_finite() {
        true => Ok(Length::from_metres(metres)),
        false => Err(PyValueError::new_err(format!("{name} is {metres}: a length is above 0 (metres)"))),
    }
}

fn count(name: &str, value: &Bound<'_, PyAny>) -> PyResult<u32> {
    let count = value.extract::<i64>()?;
    match u32::try_from(count) {
        Ok(count) if count > 0 => Ok(count),
        _ => Err(PyValueError::new_err(format!("{name} is {count}: a number from 1 to {}", u32::MAX))),
    }
}

fn place(name: &str, value: &Bound<'_, PyAny>) -> PyResult<[f64; 3]> {
    let place = value.extract::<[f64; 3]>()?;
    match place.iter().all(|coordinate| coordinate.is_finite()) {
        true => Ok(place),
        false => Err(PyValueError::new_err(format!("{name} is {place:?}: coordinates are finite"))),
    }
}
