//! Lenses that bend lines: OpenCV's model, and depth images as a pinhole without it would have seen them.

use glam::DVec2;
use isv_volume::{Image, Intrinsics, Rgb};
use serde::Deserialize;
use serde_json::Value;

/// OpenCV's coefficients, in its order.
const NAMES: [&str; 8] = ["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"];

/// Coefficients of OpenCV that are not applied: thin prisms and tilted sensors.
const OTHER_NAMES: [&str; 6] = ["s1", "s2", "s3", "s4", "tau_x", "tau_y"];

/// How many numbers OpenCV's lists have.
const LENGTHS: [usize; 5] = [4, 5, 8, 12, 14];

/// What the names of lens models contain that are not OpenCV's, in lower case and without punctuation.
const OTHER_MODELS: [&str; 15] = [
    "fisheye",
    "equidistant",
    "equisolid",
    "stereographic",
    "kannala",
    "inversebrown",
    "ftheta",
    "thinprism",
    "doublesphere",
    "omnidirectional",
    "orthographic",
    "equirectangular",
    "spherical",
    "division",
    "unified",
];

/// Names of OpenCV's model and of pinholes, written likewise.
const OPENCV_MODELS: [&str; 16] = [
    "",
    "none",
    "pinhole",
    "perspective",
    "plumbbob",
    "rationalpolynomial",
    "rational",
    "brownconrady",
    "brown",
    "opencv",
    "fullopencv",
    "radtan",
    "radialtangential",
    "simplepinhole",
    "standard",
    "polynomial",
];

/// Steps in which the radius of an image is looked at.
const RADIUS_STEPS: u32 = 1024;

/// Depths that differ by a larger share lie on two surfaces, between which there is nothing.
const EDGE: f32 = 0.02;

/// OpenCV's rational model with tangential distortion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Distortion {
    /// `k1` to `k6`: the first three of the numerator, the others of the denominator.
    radial: [f64; 6],
    /// `p1` and `p2`.
    tangential: [f64; 2],
}

impl Distortion {
    /// From coefficients in OpenCV's order; nothing if all are zero.
    fn new([k1, k2, p1, p2, k3, k4, k5, k6]: [f64; 8]) -> Option<Self> {
        let distortion = Self { radial: [k1, k2, k3, k4, k5, k6], tangential: [p1, p2] };
        let is_none = distortion.radial == [0.0; 6] && distortion.tangential == [0.0; 2];
        (!is_none).then_some(distortion)
    }

    /// The factor by which a distance from the axis changes, at the square of that distance; `None` at a pole.
    fn factor(&self, r2: f64) -> Option<f64> {
        let [k1, k2, k3, k4, k5, k6] = self.radial;
        let below = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6));
        (below > 0.0).then(|| (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / below)
    }

    /// Point at which the lens shows what a pinhole shows at `p`. Both lie on the plane at distance 1.
    fn distort(&self, p: DVec2) -> Option<DVec2> {
        let ([p1, p2], r2) = (self.tangential, p.length_squared());
        let both = 2.0 * p.x * p.y;
        let aside =
            DVec2::new(p1 * both + p2 * (r2 + 2.0 * p.x * p.x), p1 * (r2 + 2.0 * p.y * p.y) + p2 * both);
        Some(p * self.factor(r2)? + aside)
    }

    /// The square of the radius, at distance 1, up to which the model is a lens's, at most `most`. Beyond it the polynomial turns back
    /// and shows the middle of the image again.
    fn reach(&self, most: f64) -> f64 {
        let mut before = 0.0;
        for step in 1..=RADIUS_STEPS {
            let r2 = most * f64::from(step) / f64::from(RADIUS_STEPS);
            match self.factor(r2).map(|factor| factor * r2.sqrt()) {
                Some(distorted) if distorted > before => before = distorted,
                _ => return most * f64::from(step - 1) / f64::from(RADIUS_STEPS),
            }
        }
        most
    }

    /// Depths that a pinhole with the same focal lengths and principal point sees, in an image of the same
    /// size. A depth is 0 where the image had no reading or does not reach.
    ///
    /// Depth is along z, so it stays what it is and only moves. Within a surface its inverse is interpolated, which is exact for planes;
    /// at edges the nearest reading is taken, as there is no surface between.
    pub(crate) fn undistort(&self, lens: &Intrinsics, depths: &[f32]) -> Vec<f32> {
        let source = Readings { depths, width: lens.width as usize, height: lens.height as usize };
        self.places(lens).map(|place| place.map_or(0.0, |place| source.at(place))).collect()
    }

    /// Straightens an image: to what a pinhole with the same focal lengths and principal point sees, at the same size.
    ///
    /// The flags tell which of its pixels the distorted image shows. sRGB values are averaged as they are.
    pub(crate) fn undistort_colours(&self, lens: &Intrinsics, image: &Image) -> (Image, Vec<bool>) {
        let far = DVec2::new(f64::from(lens.width), f64::from(lens.height)) - 0.5;
        let colour = |place: Option<DVec2>| {
            let place = place.filter(|p| p.cmpge(DVec2::splat(-0.5)).all() && p.cmple(far).all())?;
            Some(image.bilinear(place.x + 0.5, place.y + 0.5).map(|channel| channel.round() as u8))
        };
        let colours: Vec<Option<Rgb>> = self.places(lens).map(colour).collect();
        let shown = colours.iter().map(Option::is_some).collect();
        let pixels = colours.into_iter().map(Option::unwrap_or_default).collect();
        (Image::new(lens.width, lens.height, pixels).expect("a pixel a place"), shown)
    }

    /// Place in the distorted image of each pixel of a pinhole's, row after row; `None` beyond the reach of the model.
    fn places(&self, lens: &Intrinsics) -> impl Iterator<Item = Option<DVec2>> {
        let lens = *lens;
        let ideal = move |column: u32, row: u32| {
            (DVec2::new(f64::from(column), f64::from(row)) - lens.principal) / lens.focal
        };
        let (right, bottom) = (lens.width - 1, lens.height - 1);
        let corners = [ideal(0, 0), ideal(right, 0), ideal(0, bottom), ideal(right, bottom)];
        let reach = self.reach(corners.iter().map(|p| p.length_squared()).fold(0.0, f64::max));
        let place = move |row: u32, column: u32| {
            let p = ideal(column, row);
            let seen = if p.length_squared() <= reach { self.distort(p) } else { None };
            seen.map(|p| p * lens.focal + lens.principal)
        };
        (0..lens.height).flat_map(move |row| (0..lens.width).map(move |column| place(row, column)))
    }
}

/// A depth image that is looked at between its pixels.
struct Readings<'a> {
    depths: &'a [f32],
    width: usize,
    height: usize,
}

impl Readings<'_> {
    /// The depth at a column and row, which need not be whole; 0 where there is none.
    fn at(&self, place: DVec2) -> f32 {
        let nearest = self.pixel(place.x.round(), place.y.round());
        if nearest == 0.0 {
            return 0.0;
        }
        let low = place.floor();
        let corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)]
            .map(|(right, down)| self.pixel(low.x + right, low.y + down));
        let (least, most) = corners
            .iter()
            .fold((f32::MAX, 0f32), |(least, most), depth| (least.min(*depth), most.max(*depth)));
        if least == 0.0 || most - least > EDGE * most {
            return nearest;
        }
        let [a, b, c, d] = corners.map(|depth| 1.0 / f64::from(depth));
        let part = place - low;
        let (upper, lower) = (a + (b - a) * part.x, c + (d - c) * part.x);
        (1.0 / (upper + (lower - upper) * part.y)) as f32
    }

    /// The reading of a pixel; 0 if there is none or no such pixel.
    fn pixel(&self, column: f64, row: f64) -> f32 {
        let is_inside =
            (0.0..self.width as f64).contains(&column) && (0.0..self.height as f64).contains(&row);
        let depth = if is_inside { self.depths[row as usize * self.width + column as usize] } else { 0.0 };
        if depth.is_finite() && depth > 0.0 { depth } else { 0.0 }
    }
}

/// All keys of a lens that say something of its distortion. `null` is as good as no key.
#[derive(Debug, Default, Deserialize)]
pub(crate) struct DistortionKeys {
    k1: Option<Value>,
    k2: Option<Value>,
    k3: Option<Value>,
    k4: Option<Value>,
    k5: Option<Value>,
    k6: Option<Value>,
    p1: Option<Value>,
    p2: Option<Value>,
    s1: Option<Value>,
    s2: Option<Value>,
    s3: Option<Value>,
    s4: Option<Value>,
    tau_x: Option<Value>,
    tau_y: Option<Value>,
    distortion: Option<Value>,
    distortion_coefficients: Option<Value>,
    distortion_coeffs: Option<Value>,
    dist_coeffs: Option<Value>,
    #[serde(rename = "distCoeffs")]
    dist_coeffs_of_opencv: Option<Value>,
    dist_coeff: Option<Value>,
    dist: Option<Value>,
    coeffs: Option<Value>,
    distortion_model: Option<Value>,
    camera_model: Option<Value>,
    model: Option<Value>,
    fisheye: Option<Value>,
    is_fisheye: Option<Value>,
}

impl DistortionKeys {
    /// The distortion that the keys give, if there is any; or why it cannot be applied.
    pub(crate) fn check(&self) -> Result<Option<Distortion>, String> {
        let mut given = Coefficients::default();
        let single = [&self.k1, &self.k2, &self.p1, &self.p2, &self.k3, &self.k4, &self.k5, &self.k6];
        for (index, value) in single.into_iter().enumerate() {
            if let Some(value) = value {
                given.set(index, number(NAMES[index], value)?, NAMES[index])?;
            }
        }
        let other = [&self.s1, &self.s2, &self.s3, &self.s4, &self.tau_x, &self.tau_y];
        for (name, value) in OTHER_NAMES.into_iter().zip(other) {
            check_other(name, value.as_ref())?;
        }
        for (key, value) in [
            ("distortion", &self.distortion),
            ("distortion_coefficients", &self.distortion_coefficients),
            ("distortion_coeffs", &self.distortion_coeffs),
            ("dist_coeffs", &self.dist_coeffs),
            ("distCoeffs", &self.dist_coeffs_of_opencv),
            ("dist_coeff", &self.dist_coeff),
            ("dist", &self.dist),
            ("coeffs", &self.coeffs),
        ] {
            if let Some(value) = value {
                given.add(key, value)?;
            }
        }
        for value in [&self.fisheye, &self.is_fisheye] {
            if *value == Some(Value::Bool(true)) {
                return Err(of_another_model("fisheye"));
            }
        }
        // A model may be that of a device, too.
        for value in [&self.model, &self.camera_model] {
            if let Some(Value::String(name)) = value {
                check_model(name)?;
            }
        }
        let distortion = Distortion::new(given.values.map(Option::unwrap_or_default));
        if let Some(Value::String(name)) = &self.distortion_model {
            check_model(name)?;
            if distortion.is_some() && !OPENCV_MODELS.contains(&plain(name).as_str()) {
                return Err(of_another_model(name));
            }
        }
        Ok(distortion)
    }
}

/// Coefficients as far as they were given, in OpenCV's order.
#[derive(Default)]
struct Coefficients {
    values: [Option<f64>; 8],
}

impl Coefficients {
    /// Takes a coefficient that `key` gives.
    fn set(&mut self, index: usize, value: f64, key: &str) -> Result<(), String> {
        match self.values[index].replace(value) {
            Some(before) if before != value => {
                let name = NAMES[index];
                Err(format!("{name} is {before}, but {value} in `{key}`: give the distortion once"))
            }
            _ => Ok(()),
        }
    }

    /// Takes what a key gives: a list, a list in a list as OpenCV's matrices are, or an object.
    fn add(&mut self, key: &str, value: &Value) -> Result<(), String> {
        match value {
            Value::Null => Ok(()),
            Value::String(model) if OPENCV_MODELS.contains(&plain(model).as_str()) => Ok(()),
            Value::String(model) => Err(of_another_model(model)),
            Value::Array(list) => self.add_list(key, list),
            Value::Object(keys) => {
                for name in ["model", "distortion_model", "type"] {
                    if let Some(Value::String(model)) = keys.get(name) {
                        check_model(model)?;
                    }
                }
                for name in OTHER_NAMES {
                    check_other(name, keys.get(name))?;
                }
                for (index, name) in NAMES.into_iter().enumerate() {
                    if let Some(value) = keys.get(name).filter(|value| !value.is_null()) {
                        self.set(index, number(name, value)?, key)?;
                    }
                }
                for name in ["data", "coeffs", "coefficients"] {
                    if let Some(Value::Array(list)) = keys.get(name) {
                        self.add_list(key, list)?;
                    }
                }
                Ok(())
            }
            Value::Bool(_) | Value::Number(_) => {
                Err(format!("`{key}` is {value}; a list k1 k2 p1 p2 k3 k4 k5 k6 is expected"))
            }
        }
    }

    fn add_list(&mut self, key: &str, list: &[Value]) -> Result<(), String> {
        let mut numbers = Vec::new();
        for entry in list {
            match entry {
                Value::Array(row) => {
                    row.iter().try_for_each(|entry| number(key, entry).map(|x| numbers.push(x)))?;
                }
                entry => numbers.push(number(key, entry)?),
            }
        }
        let is_zero = |numbers: &[f64]| numbers.iter().all(|x| *x == 0.0);
        if !LENGTHS.contains(&numbers.len()) && !is_zero(&numbers) {
            let count = numbers.len();
            return Err(format!(
                "`{key}` has {count} numbers; 4, 5 or 8 are read, in OpenCV's order k1 k2 p1 p2 k3 k4 k5 k6"
            ));
        }
        if numbers.len() > 8 && !is_zero(&numbers[8..]) {
            return Err(format!(
                "`{key}` has coefficients of a thin prism or a tilted sensor, which are not applied: undistort the images"
            ));
        }
        numbers.iter().take(8).enumerate().try_for_each(|(index, x)| self.set(index, *x, key))
    }
}

/// A coefficient.
fn number(key: &str, value: &Value) -> Result<f64, String> {
    let number = match value {
        Value::String(text) => text.trim().parse().ok(),
        value => value.as_f64(),
    };
    number.filter(|x| x.is_finite()).ok_or_else(|| match value {
        Value::Null | Value::String(_) => format!("`{key}` has a coefficient that is no number"),
        _ => format!("`{key}` has a coefficient {value}, which is no number"),
    })
}

/// Refuses a coefficient that is not applied, unless it is zero.
fn check_other(name: &str, value: Option<&Value>) -> Result<(), String> {
    match value.filter(|value| !value.is_null()).map(|value| number(name, value)).transpose()? {
        Some(x) if x != 0.0 => Err(format!(
            "{name} is {x}; thin prisms and tilted sensors are not applied: undistort the images"
        )),
        _ => Ok(()),
    }
}

/// Refuses the name of a lens model that is known to be another than OpenCV's.
fn check_model(name: &str) -> Result<(), String> {
    let plain = plain(name);
    let is_other =
        matches!(plain.as_str(), "fov" | "mei" | "omni" | "eucm" | "ucm" | "ds" | "kb" | "kb4" | "kb8")
            || OTHER_MODELS.iter().any(|other| plain.contains(other));
    if is_other { Err(of_another_model(name)) } else { Ok(()) }
}

/// A name in lower case, without punctuation.
fn plain(name: &str) -> String {
    let name: String =
        name.chars().filter(char::is_ascii_alphanumeric).map(|c| c.to_ascii_lowercase()).take(64).collect();
    // As RealSense's tools write it.
    name.strip_prefix("distortion").map_or_else(|| name.clone(), str::to_owned)
}

fn of_another_model(name: &str) -> String {
    let name = crate::error::quote(name.as_bytes());
    format!(
        "the lens model `{name}` is not applied; only OpenCV's is (k1 to k6, p1, p2): undistort the images"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn keys(json: Value) -> Result<Option<Distortion>, String> {
        serde_json::from_value::<DistortionKeys>(json).unwrap().check()
    }

    /// Points and where OpenCV's lens shows them.
    const OPENCV: [([f64; 2], [f64; 2]); 5] = [
        ([0.0, 0.0], [0.0000000000000000, 0.0000000000000000]),
        ([0.3, -0.2], [0.2883461500176557, -0.1921354333451038]),
        ([-0.55, 0.41], [-0.4838469503457815, 0.3610050608032188]),
        ([0.7, 0.7], [0.5538251581206848, 0.5556871581206849]),
        ([-0.05, 0.9], [-0.0413728640761510, 0.7354490533707179]),
    ];

    /// What `cv2.projectPoints(numpy.array([[x, y, 1.0]]), zeros, zeros, numpy.eye(3), numpy.array([k1, k2, p1, p2, k3, k4, k5, k6]))`
    /// of OpenCV gives.
    #[test]
    fn points_fall_where_opencv_puts_them() {
        let list = json!([-0.28, 0.07, 0.0012, -0.0007, 0.013, 0.02, -0.003, 0.0005]);
        let distortion = keys(json!({ "distortion": list })).unwrap().unwrap();
        for (at, expected) in OPENCV {
            let found = distortion.distort(DVec2::from(at)).unwrap();
            assert!(found.abs_diff_eq(DVec2::from(expected), 1e-12), "{at:?}: {found} for {expected:?}");
        }
    }

    /// Pixels of a camera of 160 x 120 pixels, with K of fx 150, fy 140, cx 79.5 and cy 59.5. They are
    /// compared with `cv2.initUndistortRectifyMap(K, numpy.array([0.5, -2.6, 0.001, 0.0003]), None, K, (160,
    /// 120), cv2.CV_32FC1)`.
    #[test]
    fn pixels_come_from_where_opencv_takes_them() {
        let lens = Intrinsics {
            width: 160,
            height: 120,
            focal: DVec2::new(150.0, 140.0),
            principal: DVec2::new(79.5, 59.5),
        };
        let distortion = keys(json!({ "k1": 0.5, "k2": -2.6, "p1": 0.001, "p2": 0.0003 })).unwrap().unwrap();
        for ([column, row], expected) in [
            ([0.0, 0.0], [25.796207, 19.355665]),
            ([159.0, 119.0], [133.43105, 99.91255]),
            ([20.0, 100.0], [21.807337, 98.81092]),
            ([79.0, 60.0], [78.99999, 60.00001]),
            ([140.0, 10.0], [135.66838, 13.594925]),
        ] {
            let ideal = (DVec2::new(column, row) - lens.principal) / lens.focal;
            let found = distortion.distort(ideal).unwrap() * lens.focal + lens.principal;
            assert!(found.abs_diff_eq(DVec2::from(expected), 2e-5), "{column} {row}: {found}");
        }
    }

    const LENS: Intrinsics =
        Intrinsics { width: 160, height: 120, focal: DVec2::splat(150.0), principal: DVec2::new(79.5, 59.5) };

    /// The depth of a slanted plane along the ray through a point at distance 1.
    fn plane(at: DVec2) -> f64 {
        2.0 / (1.0 - 0.3 * at.x + 0.2 * at.y)
    }

    /// What a lens sees of the plane: the undistorted place of each pixel is found by iteration, as OpenCV finds it.
    fn seen(distortion: &Distortion, inside: impl Fn(DVec2) -> f64) -> Vec<f32> {
        let pixels = (0..LENS.height).flat_map(|row| (0..LENS.width).map(move |column| (column, row)));
        let depth = |(column, row): (u32, u32)| {
            let shown = (DVec2::new(f64::from(column), f64::from(row)) - LENS.principal) / LENS.focal;
            let ideal = (0..100).fold(shown, |at, _| at + shown - distortion.distort(at).unwrap());
            inside(ideal) as f32
        };
        pixels.map(depth).collect()
    }

    #[test]
    fn a_plane_seen_by_a_bending_lens_is_a_plane() {
        let distortion = keys(json!({ "dist": [-0.28, 0.07, 0.0012, -0.0007, 0.013] })).unwrap().unwrap();
        let flat = distortion.undistort(&LENS, &seen(&distortion, plane));
        let mut readings = 0;
        for (pixel, depth) in flat.iter().enumerate() {
            let at = DVec2::new((pixel % 160) as f64, (pixel / 160) as f64);
            let expected = plane((at - LENS.principal) / LENS.focal);
            readings += usize::from(*depth > 0.0);
            assert!(
                *depth == 0.0 || (f64::from(*depth) / expected - 1.0).abs() < 1e-3,
                "{at}: {depth}, not {expected}"
            );
        }
        assert_eq!(readings, 160 * 120, "a barrel shows more than a pinhole");
    }

    #[test]
    fn nothing_is_put_between_a_surface_and_what_is_behind_it() {
        let distortion = keys(json!({ "k1": -0.2 })).unwrap().unwrap();
        let step = |at: DVec2| {
            if at.x < 0.1 {
                1.0
            } else if at.y < 0.2 {
                1.5
            } else {
                0.0
            }
        };
        for depth in distortion.undistort(&LENS, &seen(&distortion, step)) {
            assert!([0.0, 1.0, 1.5].contains(&depth), "{depth}");
        }
        let broken = [f32::NAN, f32::INFINITY, -1.0].repeat(160 * 40);
        assert_eq!(distortion.undistort(&LENS, &broken), vec![0.0; 160 * 120]);
    }

    /// A polynomial turns back beyond some radius, and would show the middle of the image in its corners once more.
    #[test]
    fn corners_beyond_the_model_show_nothing() {
        for list in [json!([-1.0, 0, 0, 0]), json!([0, 0, 0, 0, 0, -4.0, 0, 0])] {
            let distortion = keys(json!({ "distortion": list })).unwrap().unwrap();
            let flat = distortion.undistort(&LENS, &vec![1.0; 160 * 120]);
            let at = |column: usize, row: usize| flat[row * 160 + column];
            assert_eq!([at(80, 60), at(0, 0), at(159, 119)], [1.0, 0.0, 0.0], "{list}");
        }
        let turning = keys(json!({ "k1": -1.0 })).unwrap().unwrap();
        assert!((turning.reach(1.0) - 1.0 / 3.0).abs() < 2e-3, "r (1 - r^2) is largest at r^2 = 1/3");
    }

    #[test]
    fn keys_come_in_several_forms() {
        let expected = keys(json!({ "k1": 0.1, "k2": 0.2, "p1": 0.3, "p2": 0.4, "k3": 0.5 })).unwrap();
        assert_eq!(expected.unwrap().radial, [0.1, 0.2, 0.5, 0.0, 0.0, 0.0]);
        for other in [
            json!({ "distortion": [0.1, 0.2, 0.3, 0.4, 0.5] }),
            json!({ "dist_coeffs": [[0.1, 0.2, 0.3, 0.4, 0.5]] }),
            json!({ "distCoeffs": [[0.1], [0.2], [0.3], [0.4], [0.5], [0], [0], [0], [0], [0], [0], [0]] }),
            json!({ "distortion": [0.1, 0.2, 0.3, 0.4, 0.5], "k1": 0.1, "distortion_model": "plumb_bob" }),
            json!({ "distortion": [0.1, 0.2, 0.3, 0.4, 0.5], "dist_coeffs": [0.1, 0.2, 0.3, 0.4], "k5": null }),
            json!({ "distortion_coefficients": { "rows": 1, "cols": 5, "data": [0.1, 0.2, 0.3, 0.4, 0.5] } }),
            json!({ "distortion": { "k1": 0.1, "k2": 0.2, "p1": 0.3, "p2": 0.4, "k3": 0.5, "model": "OPENCV" } }),
            json!({ "distortion": "brown-conrady", "coeffs": [0.1, 0.2, 0.3, 0.4, 0.5] }),
            // Names of devices.
            json!({ "distortion": [0.1, 0.2, 0.3, 0.4, 0.5], "model": "Azure Kinect DK", "distortion_model": "rational" }),
        ] {
            assert_eq!(keys(other.clone()).unwrap(), expected, "{other}");
        }
        for none in [
            json!({}),
            json!({ "distortion": null }),
            json!({ "distortion": [] }),
            json!({ "distortion": [0, 0, 0] }),
            json!({ "distortion": "none", "k1": 0 }),
            json!({ "coeffs": [0, 0, 0, 0, 0], "distortion_model": "brown_conrady", "s1": 0, "is_fisheye": false }),
        ] {
            assert_eq!(keys(none.clone()), Ok(None), "{none}");
        }
    }

    #[test]
    fn what_cannot_be_applied_is_refused_by_its_name() {
        for (wrong, expected) in [
            (json!({ "distortion": [0.1, 0, 0, 0], "model": "fisheye" }), "`fisheye` is not applied"),
            (json!({ "distortion_model": "equidistant" }), "`equidistant` is not applied"),
            (json!({ "camera_model": "OPENCV_FISHEYE" }), "`OPENCV_FISHEYE` is not applied"),
            (json!({ "distortion": "kannala_brandt4" }), "`kannala_brandt4` is not applied"),
            (json!({ "distortion": { "type": "Equidistant", "k1": 0 } }), "`Equidistant` is not applied"),
            (json!({ "is_fisheye": true }), "`fisheye` is not applied"),
            (json!({ "distortion_model": "own", "k1": 1 }), "`own` is not applied"),
            (
                json!({ "distortion": [0, 0, 0, 0, 0, 0, 0, 0, 0.1, 0, 0, 0] }),
                "`distortion` has coefficients of a thin prism",
            ),
            (json!({ "s2": 0.1 }), "s2 is 0.1; thin prisms"),
            (json!({ "dist": [0.1, 0.2, 0.3] }), "`dist` has 3 numbers; 4, 5 or 8 are read"),
            (json!({ "distortion": 0.1 }), "`distortion` is 0.1; a list"),
            (json!({ "distortion": [0.1, 0, 0, 0], "k1": 0.2 }), "k1 is 0.2, but 0.1 in `distortion`"),
            (json!({ "distortion": [0.1, "", 0, 0] }), "`distortion` has a coefficient that is no number"),
            (json!({ "k1": [1] }), "`k1` has a coefficient [1], which is no number"),
        ] {
            let why = keys(wrong.clone()).unwrap_err();
            assert!(why.contains(expected), "{wrong}: {why}");
        }
    }
}
