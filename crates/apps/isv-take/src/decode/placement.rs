//! The coordinates of what is decoded: unit, origin and up axis.

use super::product::Product;
use super::{DecodeEvent, DecodeOptions, DecodeOptionsError, Form, OutputFormat, PlacementOption};
use crate::{Event, Length, Observer, Up};
use glam::DVec3;
use isv_format::FrameRate;
use isv_io::{Format, Geometry, GlbEncoding, Placement, Unit, UsdStage};
use isv_volume::{PointCloud, TriangleMesh};

/// Rounding of coordinates that nobody minds, in metres, where voxels are large.
const ROUNDING_M: f64 = 1e-4;

/// Share of a voxel's edge that rounding may take.
const ROUNDING_VOXELS: f64 = 0.1;

/// The unit, origin and up axis of what is written.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placed {
    pub(super) unit: Unit,
    up: Up,
    /// Axis of the stream that points up.
    stream_up: Up,
    pub(super) placement: Placement,
    /// What is rounded to single precision, if nothing was said of it yet.
    rounded: Option<Rounded>,
}

/// Coordinates that a format holds in single precision alone.
#[derive(Clone, Copy, Debug)]
struct Rounded {
    format: &'static str,
    /// What is added to them before they are rounded.
    translation: DVec3,
}

impl Placed {
    /// How products in a format are placed.
    pub(super) fn new(
        options: &DecodeOptions,
        form: Form,
        format: OutputFormat,
        voxel_m: f64,
        stream_up: Up,
        observer: &dyn Observer,
    ) -> Result<Self, DecodeOptionsError> {
        let DecodeOptions { unit, up, origin, .. } = *options;
        let has_other_axes = unit != Unit::Metre || up != Up::Y;
        let given = [
            (PlacementOption::Unit, unit != Unit::Metre),
            (PlacementOption::Origin, origin.is_some()),
            (PlacementOption::Up, up != Up::Y),
        ];
        let is_kept = |option: PlacementOption| {
            form != Form::Volume || (format == OutputFormat::Vdb && option != PlacementOption::Up)
        };
        if let Some((option, _)) = given.into_iter().find(|(option, given)| *given && !is_kept(*option)) {
            return Err(match format {
                OutputFormat::Vdb => DecodeOptionsError::VolumePlaced { option },
                _ => DecodeOptionsError::ArraysPlaced { option },
            });
        }
        if matches!(format, OutputFormat::Geometry(Format::Glb)) && has_other_axes {
            observer.event(&Event::Decode(DecodeEvent::NotGltf { unit, up }));
        }
        if matches!(format, OutputFormat::Usd(_)) && !matches!(up, Up::Y | Up::Z) {
            return Err(DecodeOptionsError::NoUsdAxis { up: up.name() });
        }
        let tolerance = ROUNDING_M.min(ROUNDING_VOXELS * voxel_m) / unit.metres();
        let translation = DVec3::from(origin.unwrap_or_default());
        // Others than STL have a place of their own for the origin.
        let rounded = match format {
            OutputFormat::Geometry(Format::Stl) => Some(Rounded { format: "STL", translation }),
            OutputFormat::Geometry(Format::Glb) if options.glb.unwrap_or_default() == GlbEncoding::Plain => {
                Some(Rounded { format: "plain glTF", translation: DVec3::ZERO })
            }
            OutputFormat::Usd(_) => Some(Rounded { format: "USD", translation: DVec3::ZERO }),
            _ => None,
        };
        Ok(Self { unit, up, stream_up, placement: Placement { translation, tolerance }, rounded })
    }

    /// What a USD file says of its coordinates and times.
    pub(super) fn usd_stage(&self, rate: FrameRate) -> UsdStage {
        UsdStage {
            frames_per_second: rate.per_second(),
            metres_per_unit: self.unit.metres(),
            z_up: self.up == Up::Z,
            translation: self.placement.translation,
        }
    }

    /// A product in the output's unit and axes. Writers add the origin, as formats do it in ways of their own.
    pub(super) fn turn(&self, product: Product) -> Product {
        if self.unit == Unit::Metre && self.up == self.stream_up {
            return product;
        }
        let rotation = self.up.to_y_up().transpose() * self.stream_up.to_y_up();
        let scale = self.unit.metres();
        let scaled = |positions: &mut Vec<DVec3>| positions.iter_mut().for_each(|v| *v /= scale);
        match product {
            Product::Mesh(mesh) => {
                let Geometry::Mesh(mut mesh) = Geometry::Mesh(mesh).turned(rotation) else { unreachable!() };
                scaled(&mut mesh.vertices);
                Product::Mesh(mesh)
            }
            Product::Points(points) => {
                let Geometry::Points(mut points) = Geometry::Points(points).turned(rotation) else {
                    unreachable!()
                };
                scaled(&mut points.positions);
                Product::Points(points)
            }
            volume @ Product::Volume { .. } => volume,
        }
    }

    /// Tells once that a file cannot hold its coordinates well.
    pub(super) fn tell_if_rounded(&mut self, product: &Product, observer: &dyn Observer) {
        let positions = match product {
            Product::Mesh(TriangleMesh { vertices, .. }) => vertices,
            Product::Points(PointCloud { positions, .. }) => positions,
            Product::Volume { .. } => return,
        };
        let Some(Rounded { format, translation }) = self.rounded else { return };
        if (Placement { translation, ..self.placement }).needs_double(positions) {
            self.rounded = None;
            let far = positions.iter().map(|v| (*v + translation).abs().max_element());
            let spacing = far.fold(0f64, f64::max) * f64::from(f32::EPSILON) * self.unit.metres();
            let spacing = Length::from_metres(spacing);
            observer.event(&Event::Decode(DecodeEvent::Rounded { format, spacing }));
        }
    }
}
