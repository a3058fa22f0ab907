//! `isv encode --bitrate` of takes with colour.

mod support;

use support::Workspace;

/// Encodes painted balls; returns the rate of all (Mbps) and the bytes of geometry and of colour.
fn encode(work: &Workspace, options: &[&str]) -> (f64, [f64; 2]) {
    let usual = ["encode", "balls", "-o", "take.isv", "--voxel", "20mm", "--fps", "30", "--gop", "10"];
    work.isv(&[&usual, options].concat()).done();
    let info = work.isv(&["info", "take.isv", "--json"]).json();
    let bytes = ["bytes_geometry", "bytes_colour"].map(|key| info[key].as_f64().unwrap());
    std::fs::remove_file(work.path("take.isv")).unwrap();
    (info["bitrate_mbps"].as_f64().unwrap(), bytes)
}

#[test]
fn two_passes_meet_a_rate_that_pays_for_geometry_and_colour() {
    let work = Workspace::with_painted_balls(10);
    let rates = ["60k", "100k"].map(|rate| encode(&work, &["--bitrate", rate, "--passes", "2"]));
    for ((rate, [geometry, colour]), wanted) in rates.into_iter().zip([0.06, 0.1]) {
        assert!((rate / wanted - 1.0).abs() < 0.05, "{rate} for {wanted} Mbps");
        let share = colour / (geometry + colour);
        assert!((0.2..0.9).contains(&share), "{share} of {wanted} Mbps is colour");
    }
    // Both get more of more.
    let [(_, low), (_, high)] = rates;
    assert!(high[0] > low[0] && high[1] > low[1], "{low:?}, {high:?}");
}

#[test]
fn a_quality_of_colour_leaves_the_rest_of_a_rate_to_geometry() {
    let work = Workspace::with_painted_balls(10);
    // Metadata would be a quarter of a third of a second at this rate.
    let rate = ["--metadata", "never", "--bitrate", "45k", "--passes", "2", "--colour-quality"];
    let [coarse, fine] = ["20", "30"].map(|quality| encode(&work, &[&rate[..], &[quality]].concat()));
    for (rate, _) in [coarse, fine] {
        assert!((rate / 0.045 - 1.0).abs() < 0.1, "{rate} Mbps");
    }
    assert!(coarse.1[0] > fine.1[0] && coarse.1[1] < fine.1[1], "{coarse:?}, {fine:?}");
    let (_, constant) = encode(&work, &["--colour-quality", "30"]);
    let change = fine.1[1] / constant[1];
    assert!((0.8..1.25).contains(&change), "colour of one quality hardly depends on geometry: {change}");
}

/// The second half of a take comes after a pause, which costs nothing and counts.
#[test]
fn two_passes_count_the_time_of_pauses() {
    let work = Workspace::with_figure(8);
    for frame in (4..8).rev() {
        let place = |number: usize| work.path(&format!("frames/frame_{number}.ply"));
        std::fs::rename(place(frame), place(frame + 8)).unwrap();
    }
    let encode = ["encode", "frames", "-o", "take.isv", "--voxel=20mm", "--gop=4", "--metadata=never"];
    work.isv(&[&encode[..], &["--bitrate=300k", "--passes=2"]].concat()).done();
    let info = work.isv(&["info", "take.isv", "--json"]).json();
    assert_eq!(info["duration_s"].as_f64().map(|seconds| (30.0 * seconds).round()), Some(16.0));
    let rate = info["bitrate_mbps"].as_f64().unwrap();
    assert!((rate / 0.3 - 1.0).abs() < 0.05, "{rate} Mbps");
}
