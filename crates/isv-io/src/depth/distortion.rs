//! Lens distortion: images are undistorted as they are read, so that all that follows has pinholes.

use glam::DVec2;
use isv_volume::Intrinsics;
use serde::Deserialize;
use serde_json::Value;

/// OpenCV's rational model (its documentation of `calib3d`): radial `k1` to `k6`, tangential `p1` and `p2`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Distortion {
    k: [f64; 6],
    p: [f64; 2],
}

/// The keys of a camera that say how its lens distorts.
#[derive(Debug, Default, Deserialize)]
pub(crate) struct DistortionKeys {
    k1: Option<f64>,
    k2: Option<f64>,
    k3: Option<f64>,
    k4: Option<f64>,
    k5: Option<f64>,
    k6: Option<f64>,
    p1: Option<f64>,
    p2: Option<f64>,
    /// In OpenCV's order: k1, k2, p1, p2, k3, k4, k5, k6.
    #[serde(
        alias = "distortion_coefficients",
        alias = "dist_coeffs",
        alias = "distCoeffs",
        alias = "dist_coeff",
        alias = "coeffs",
        alias = "dist"
    )]
    distortion: Option<Value>,
    #[serde(alias = "camera_model", alias = "model")]
    distortion_model: Option<Value>,
}

/// Names of models that are this one or a part of it, in lower case, with letters alone.
const MODELS: [&str; 13] = [
    "",
    "none",
    "pinhole",
    "opencv",
    "fullopencv",
    "plumbbob",
    "rationalpolynomial",
    "rational",
    "brownconrady",
    "brown",
    "radtan",
    "radialtangential",
    "perspective",
];

impl DistortionKeys {
    /// The distortion, if any number is not zero.
    pub(crate) fn check(self) -> Result<Option<Distortion>, String> {
        let mut coefficients = [self.k1, self.k2, self.p1, self.p2, self.k3, self.k4, self.k5, self.k6];
        if let Some(list) = &self.distortion {
            let numbers = list_of(list)?;
            if let Some(beyond) = numbers.iter().skip(8).find(|number| **number != 0.0) {
                return Err(format!(
                    "a distortion coefficient beyond k6 is {beyond}; k1 to k6, p1 and p2 are understood"
                ));
            }
            for (index, number) in numbers.into_iter().take(8).enumerate() {
                if coefficients[index].is_some_and(|other| other != number) {
                    return Err("two keys say different distortion coefficients".to_owned());
                }
                coefficients[index] = Some(number);
            }
        }
        let [k1, k2, p1, p2, k3, k4, k5, k6] = coefficients.map(Option::unwrap_or_default);
        let distortion = Distortion { k: [k1, k2, k3, k4, k5, k6], p: [p1, p2] };
        if distortion.k == [0.0; 6] && distortion.p == [0.0; 2] {
            return Ok(None);
        }
        if let Some(Value::String(name)) = &self.distortion_model {
            let letters: String =
                name.chars().filter(char::is_ascii_alphabetic).collect::<String>().to_ascii_lowercase();
            if !MODELS.contains(&letters.as_str()) {
                let name: String = name.chars().take(40).flat_map(char::escape_debug).collect();
                return Err(format!(
                    "the distortion model `{name}` is not understood; undistort the images first"
                ));
            }
        }
        Ok(Some(distortion))
    }
}

/// Numbers of a list, or of a list of one list as OpenCV writes matrices.
fn list_of(value: &Value) -> Result<Vec<f64>, String> {
    let wrong = || "the distortion must be a list of numbers: k1, k2, p1, p2, k3, k4, k5, k6".to_owned();
    let list = match value {
        Value::Null => return Ok(Vec::new()),
        Value::Array(list) => list,
        _ => return Err(wrong()),
    };
    match &list[..] {
        [Value::Array(inner)] => inner.iter().map(|number| number.as_f64().ok_or_else(wrong)).collect(),
        // A column of rows of one number.
        rows => rows
            .iter()
            .map(|row| match row {
                Value::Array(one) if one.len() == 1 => one[0].as_f64().ok_or_else(wrong),
                number => number.as_f64().ok_or_else(wrong),
            })
            .collect(),
    }
}

impl Distortion {
    /// Where a point of the plane at distance 1 falls after distortion, on the same plane.
    fn distort(&self, at: DVec2) -> DVec2 {
        let [k1, k2, k3, k4, k5, k6] = self.k;
        let [p1, p2] = self.p;
        let r2 = at.length_squared();
        let radial = (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)));
        let xy = 2.0 * at.x * at.y;
        at * radial
            + DVec2::new(p1 * xy + p2 * (r2 + 2.0 * at.x * at.x), p2 * xy + p1 * (r2 + 2.0 * at.y * at.y))
    }

    /// The image that a pinhole with the same intrinsics would have seen. Each pixel takes the nearest one of the image as taken: depths
    /// are not mixed over edges. A pixel that the image as taken does not show has no reading.
    pub(crate) fn undistort(&self, lens: &Intrinsics, depths: &[f32]) -> Vec<f32> {
        let (width, height) = (lens.width as usize, lens.height as usize);
        let mut out = Vec::with_capacity(depths.len());
        for row in 0..height {
            for column in 0..width {
                let at = (DVec2::new(column as f64, row as f64) - lens.principal) / lens.focal;
                let seen = (self.distort(at) * lens.focal + lens.principal).round();
                let inside =
                    seen.x >= 0.0 && seen.y >= 0.0 && seen.x < width as f64 && seen.y < height as f64;
                out.push(if inside { depths[seen.y as usize * width + seen.x as usize] } else { 0.0 });
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn keys(json: Value) -> Result<Option<Distortion>, String> {
        serde_json::from_value::<DistortionKeys>(json).unwrap().check()
    }

    /// What `cv2.projectPoints(numpy.array([[x, y, 1.0]]), zeros, zeros, numpy.eye(3), numpy.array([k1, k2, p1, p2, k3, k4, k5, k6]))`
    /// of OpenCV gives.
    #[test]
    fn points_fall_where_opencv_puts_them() {
        let list = json!([-0.28, 0.07, 0.0012, -0.0007, 0.013, 0.02, -0.003, 0.0005]);
        let distortion = keys(json!({ "distortion": list })).unwrap().unwrap();
        for (at, expected) in OPENCV {
            let found = distortion.distort(DVec2::from(at));
            assert!(found.abs_diff_eq(DVec2::from(expected), 1e-12), "{at:?}: {found} for {expected:?}");
        }
    }

    #[test]
    fn keys_come_in_several_forms() {
        let expected = keys(json!({ "k1": 0.1, "k2": 0.2, "p1": 0.3, "p2": 0.4, "k3": 0.5 })).unwrap();
        assert!(expected.is_some());
        for other in [
            json!({ "distortion": [0.1, 0.2, 0.3, 0.4, 0.5] }),
            json!({ "dist_coeffs": [[0.1, 0.2, 0.3, 0.4, 0.5]] }),
            json!({ "distCoeffs": [[0.1], [0.2], [0.3], [0.4], [0.5], [0], [0], [0], [0], [0], [0], [0]] }),
            json!({ "distortion": [0.1, 0.2, 0.3, 0.4, 0.5], "k1": 0.1, "model": "plumb_bob" }),
        ] {
            assert_eq!(keys(other.clone()).unwrap(), expected, "{other}");
        }
        assert_eq!(keys(json!({ "distortion": [0, 0, 0, 0, 0], "model": "fisheye" })), Ok(None));
        assert_eq!(keys(json!({})), Ok(None));
        for wrong in [
            json!({ "distortion": [0.1], "model": "fisheye" }),
            json!({ "distortion": [0, 0, 0, 0, 0, 0, 0, 0, 0.1] }),
            json!({ "distortion": "strong" }),
            json!({ "distortion": [0.1], "k1": 0.2 }),
        ] {
            assert!(keys(wrong.clone()).is_err(), "{wrong}");
        }
    }
    const OPENCV: [([f64; 2], [f64; 2]); 5] = [
        ([0.0, 0.0], [0.0000000000000000, 0.0000000000000000]),
        ([0.3, -0.2], [0.2883461500176557, -0.1921354333451038]),
        ([-0.55, 0.41], [-0.4838469503457815, 0.3610050608032188]),
        ([0.7, 0.7], [0.5538251581206848, 0.5556871581206849]),
        ([-0.05, 0.9], [-0.0413728640761510, 0.7354490533707179]),
    ];
}
