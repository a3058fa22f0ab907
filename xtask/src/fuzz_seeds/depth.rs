//! Depth images of 8 x 6 pixels and the texts that come with them; which images lie beside a text, its target says.

use super::Seeds;
use anyhow::Result;
use isv_testfiles::{exr, png};

pub(super) fn save(seeds: &mut Seeds) -> Result<()> {
    let values: Vec<u16> = (0..48).map(|i| 1000 + i * i).collect();
    for image in png::all_kinds(8, &values) {
        seeds.save("depth_png", &image)?;
    }
    for (_, image) in exr::all_kinds([8, 6]) {
        seeds.save("depth_exr", &image)?;
    }
    for image in exr::DWA {
        seeds.save("depth_exr", image)?;
    }
    for (target, texts) in [("camera_json", &CAMERAS[..]), ("rig", &RIGS), ("tum", &TUM)] {
        for text in texts {
            seeds.save(target, text.as_bytes())?;
        }
    }
    Ok(())
}

const CAMERAS: [&str; 2] = [
    r#"{"width": 8, "height": 6, "fx": 8, "fy": 8, "cx": 3.5, "cy": 2.5, "fps": 30, "depth_scale_m": 0.001,
 "poses": [[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]], [[0,-1,0,0.5],[1,0,0,-2],[0,0,1,1e-3],[0,0,0,1]]]}"#,
    r#"{"poses": [[[1,0,0,0],[0,0.6,-0.8,0],[0,0.8,0.6,0],[0,0,0,1]], [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]],
 "invalid_values": [0, 1000, 65535], "width": 8, "height": 6, "fx": 8.5, "fy": 7.5e0, "cx": 3.5, "cy": 2.5, "note": [null, "x"]}"#,
];

const RIGS: [&str; 3] = [
    r#"{"fps": 30, "cameras": [{"name": "front", "width": 8, "height": 6, "fx": 8, "fy": 8, "cx": 3.5, "cy": 2.5,
 "camera_to_world": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]], "images": "front", "depth_scale_m": 0.001}]}"#,
    r#"{"cameras": [{"name": "a", "width": 8, "height": 6, "fx": 8, "fy": 8, "cx": 3.5, "cy": 2.5, "images": "front/?.png",
 "camera_to_world": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]], "invalid_values": [0, 1000]},
 {"name": "b", "width": 8, "height": 6, "fx": 9, "fy": 9, "cx": 3.5, "cy": 2.5, "images": "back/left_*.exr",
 "camera_to_world": [[-1,0,0,0.25],[0,1,0,0],[0,0,-1,-2],[0,0,0,1]]}]}"#,
    r#"{"fps": 1e-1, "cameras": [{"name": "", "width": 8, "height": 6, "fx": 8, "fy": 8, "cx": 3.5, "cy": 2.5, "images": "./back",
 "camera_to_world": [[0,-1,0,0.5],[1,0,0,-2],[0,0,1,1e-3],[0,0,0,1]]}]}"#,
];

const TUM: [&str; 4] = [
    "# time file\n1.00 depth/0.png\n1.03 depth/1.png\n\n\n# time tx ty tz qx qy qz qw\n1.00 0 0 0 0 0 0 1\n1.03 1 0 0 0 0 0 1\n",
    "1.02 depth/0.png\n1.01 depth/1.png\n9 depth/0.png\n\n\n1.04 0 0 0 0 0 0.7071 0.7071\n1.00 1 0 0 0.6 0 0.8 0\n\n\n8 8 3.5 2.5 8 6\n",
    "1 depth/0.png\n\n\n1 0 0 0 0 0 0 1\n\n\n525 525 319.5 239.5\n",
    "1 depth/0.png\n\n\n1 0 0 0 0 0 0 1\n\n\n{\"width\": 8, \"height\": 6, \"fx\": 8, \"fy\": 8, \"cx\": 3.5, \"cy\": 2.5}",
];
