//! The coordinates of what is decoded: unit, origin and up axis.

use super::product::{OutputFormat, Product};
use crate::failure::usage;
use crate::origin;
use crate::output::say;
use crate::terms::FormName;
use crate::terms::UpName;
use anyhow::Result;
use glam::DVec3;
use isv::raw::io::{Format, Geometry, Placement, Unit};
use isv::raw::take::Length;
use isv::raw::take::Up;
use isv::raw::volume::{PointCloud, TriangleMesh};

/// Rounding of coordinates that nobody minds, in metres, where voxels are large.
const ROUNDING_M: f64 = 1e-4;

/// Share of a voxel's edge that rounding may take.
const ROUNDING_VOXELS: f64 = 0.1;

/// Coordinates of the output
#[derive(Clone, Copy, Debug, clap::Args)]
#[command(next_help_heading = "Coordinates of the output")]
pub(super) struct TargetFrameArgs {
    /// Unit of the output's coordinates: m, dm, cm, mm, in, ft or us-ft
    #[arg(long, default_value_t = Unit::Metre)]
    units: Unit,
    /// Place of the stream's origin in the output: what isv encode was told
    ///
    /// It is in the unit of the output. Restores survey coordinates. PLY, OBJ and PCD files hold them in double precision where single precision would lose
    /// more than 0.1 mm or a tenth of a voxel; a GLB file moves its nodes; STL files cannot, and isv says so.
    #[arg(long, value_name = "X,Y,Z", value_parser = origin::parse, allow_hyphen_values = true)]
    origin: Option<[f64; 3]>,
    /// Axis of the output that points up; streams are Y up
    #[arg(long, value_enum, default_value = "y", allow_hyphen_values = true)]
    up: UpName,
}

impl TargetFrameArgs {
    /// How products in a format are placed.
    pub(super) fn target_frame(
        &self,
        form: FormName,
        format: OutputFormat,
        voxel_m: f64,
    ) -> Result<TargetFrame> {
        let moved = DVec3::from(self.origin.unwrap_or_default());
        let turned = self.up != UpName::Y;
        let given =
            [("--units", self.units != Unit::Metre), ("--origin", self.origin.is_some()), ("--up", turned)];
        let kept = |flag: &str| form != FormName::Volume || (format == OutputFormat::Vdb && flag != "--up");
        if let Some((flag, _)) = given.into_iter().find(|(flag, given)| *given && !kept(flag)) {
            return Err(usage(match format {
                OutputFormat::Vdb => {
                    format!("{flag}: a volume keeps its axes: decode a mesh or points, or turn it later")
                }
                _ => format!(
                    "{flag}: NumPy volumes are in metres, Y up: decode a mesh, points or --format vdb"
                ),
            }));
        }
        if matches!(format, OutputFormat::Geometry(Format::Glb)) && (self.units != Unit::Metre || turned) {
            let up = Up::from(self.up).name();
            say(format_args!(
                "glTF means metres and Y up: other programs will take {} and {} up for these",
                self.units, up
            ));
        }
        let tolerance = ROUNDING_M.min(ROUNDING_VOXELS * voxel_m) / self.units.metres();
        Ok(TargetFrame {
            unit: self.units,
            up: self.up.into(),
            placement: Placement { translation: moved, tolerance },
            is_rounded: matches!(format, OutputFormat::Geometry(Format::Stl)),
        })
    }
}

/// The unit, origin and up axis of what is written.
#[derive(Clone, Copy, Debug)]
pub(super) struct TargetFrame {
    pub(super) unit: Unit,
    up: Up,
    pub(super) placement: Placement,
    /// Whether the format has single precision alone, of which nothing was said yet.
    is_rounded: bool,
}

impl TargetFrame {
    /// A product in the output's unit and axes. Writers add the origin, as formats do it in ways of their own.
    pub(super) fn turn(&self, product: Product) -> Product {
        if self.unit == Unit::Metre && self.up == Up::Y {
            return product;
        }
        let rotation = self.up.to_y_up().transpose();
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
            volume @ Product::Volume(_) => volume,
        }
    }

    /// Says once that a file cannot hold its coordinates well.
    pub(super) fn say_if_rounded(&mut self, product: &Product) {
        let positions = match product {
            Product::Mesh(TriangleMesh { vertices, .. }) => vertices,
            Product::Points(PointCloud { positions, .. }) => positions,
            Product::Volume(_) => return,
        };
        if self.is_rounded && self.placement.needs_double(positions) {
            self.is_rounded = false;
            let far = positions.iter().map(|v| (*v + self.placement.translation).abs().max_element());
            let spacing = far.fold(0f64, f64::max) * f64::from(f32::EPSILON) * self.unit.metres();
            say(format_args!(
                "STL holds single precision, which is good for {} here: ply and obj hold more",
                Length::from_metres(spacing)
            ));
        }
    }
}
