//! Points of a surface.

use glam::DVec3;
use isv_volume::PointCloud;

/// Points of a surface, in metres.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Points {
    /// Positions: x, y, z.
    pub positions: Vec<[f32; 3]>,
    /// Normals that point outside, one a point, zero where one is not known; empty if there are none.
    pub normals: Vec<[f32; 3]>,
    /// 8-bit sRGB colours, one a point; empty if there are none.
    pub colours: Vec<[u8; 3]>,
    /// Place that the points were seen from, if it is known. Estimated normals face it.
    pub viewpoint: Option<[f32; 3]>,
}

impl Points {
    pub(crate) fn from_raw(points: &PointCloud) -> Self {
        let narrow = |v: &DVec3| v.as_vec3().to_array();
        Self {
            positions: points.positions.iter().map(narrow).collect(),
            normals: points.normals.iter().map(narrow).collect(),
            colours: points.colours.clone(),
            viewpoint: None,
        }
    }

    #[cfg(feature = "encode")]
    pub(crate) fn to_raw(&self) -> PointCloud {
        let wide = |v: &[f32; 3]| DVec3::from(v.map(f64::from));
        PointCloud {
            positions: self.positions.iter().map(wide).collect(),
            normals: self.normals.iter().map(|normal| wide(normal).normalize_or_zero()).collect(),
            colours: self.colours.clone(),
            viewpoint: self.viewpoint.as_ref().map(wide),
            ..PointCloud::default()
        }
    }
}
