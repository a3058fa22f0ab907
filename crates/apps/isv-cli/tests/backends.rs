//! Devices that do the arithmetic. What needs a GPU, be it one in software, says that it is skipped where
//! there is none.

mod support;

use isv_testkit::{Need, capture, skip};
use serde_json::Value;
use support::Workspace;

/// The GPUs that `isv backends` lists as usable.
fn usable_gpus(work: &Workspace) -> Vec<Value> {
    let backends = work.isv(&["backends", "--json"]).json();
    assert!(backends["cpu"]["threads"].as_u64().unwrap() > 0);
    assert!(backends["cpu"]["instruction_sets"].as_array().unwrap().contains(&"scalar".into()));
    let gpus = backends["gpus"].as_array().unwrap().iter();
    gpus.filter(|gpu| gpu["usable"] == true).cloned().collect()
}

#[test]
fn a_gpu_decodes_what_the_cpu_does() {
    let (work, _) = Workspace::with_stream(4);
    if usable_gpus(&work).is_empty() {
        skip(Need::Gpu, "no GPU");
        return;
    }
    let verified = work.isv(&["verify", "take.isv", "--backend", "gpu"]).done();
    assert_eq!(verified.stdout(), b"take.isv: 4 frames verified, 4 of them by hash\n");
    for (folder, backend) in [("cpu", "cpu"), ("gpu", "gpu")] {
        let options = ["decode", "take.isv", "-o", folder, "--normals", "--backend", backend];
        work.isv(&options).done();
    }
    assert_eq!(work.names("cpu"), work.names("gpu"));
    let evaluation = work.isv(&["eval", "cpu", "gpu", "--json"]).json();
    assert!(evaluation["hausdorff_mm"].as_f64().unwrap() < 0.001, "{evaluation}");
    assert!(evaluation["normal_error_deg"].as_f64().unwrap() < 0.01, "{evaluation}");
    // Volumes are equal byte for byte.
    for (folder, backend) in [("cpu_volumes", "cpu"), ("gpu_volumes", "gpu")] {
        work.isv(&["decode", "take.isv", "-o", folder, "--as", "volume", "--backend", backend]).done();
    }
    for frame in work.names("cpu_volumes") {
        for file in work.names(&format!("cpu_volumes/{frame}")) {
            let [cpu, gpu] = ["cpu", "gpu"].map(|of| work.read(&format!("{of}_volumes/{frame}/{file}")));
            assert!(cpu == gpu, "{frame}/{file}");
        }
    }
}

#[test]
fn a_gpu_encodes_for_every_decoder() {
    let work = Workspace::with_figure(3);
    if usable_gpus(&work).is_empty() {
        skip(Need::Gpu, "no GPU");
        return;
    }
    for profile in ["paper", "main"] {
        let options = ["encode", "frames", "--voxel", "20mm", "--checksums", "--profile", profile];
        let coded = ["cpu", "gpu"].map(|backend| {
            let output = format!("{backend}.isv");
            work.isv(&[&options[..], &["-o", &output, "--backend", backend]].concat()).done();
            let verified = work.isv(&["verify", &output]).done();
            assert!(
                String::from_utf8_lossy(verified.stdout())
                    .ends_with("3 frames verified, 3 of them by hash\n")
            );
            let error_mm = work.isv(&["eval", "frames", &output, "--json"]).json()["p2s_mean_mm"].as_f64();
            [work.read(&output).len() as f64, error_mm.unwrap()]
        });
        // Bytes and error of a few small frames.
        let [cpu, gpu] = coded;
        assert!(gpu[0] < 1.02 * cpu[0] && gpu[1] < 1.02 * cpu[1], "{profile}: {gpu:?}, on the CPU {cpu:?}");
    }
}

#[test]
fn a_gpu_fuses_depth_images() {
    let Some(room) = capture("room_rgbd") else { return };
    let work = Workspace::new();
    if usable_gpus(&work).is_empty() {
        skip(Need::Gpu, "no GPU");
        return;
    }
    let options =
        ["encode", room.to_str().unwrap(), "--voxel", "4cm", "--frames", "0..3", "--profile", "paper"];
    for mode in ["per-frame", "accumulate"] {
        let blocks = ["cpu", "gpu"].map(|backend| {
            let output = format!("{mode}_{backend}.isv");
            work.isv(&[&options[..], &["--fusion", mode, "-o", &output, "--backend", backend]].concat())
                .done();
            work.isv(&["info", &output, "--json"]).json()["packets"][2]["blocks"].as_f64().unwrap()
        });
        assert!(blocks[0] > 0.0 && (blocks[1] / blocks[0] - 1.0).abs() < 0.01, "{mode}: {blocks:?}");
    }
}

#[test]
fn auto_works_wherever_it_is() {
    let (work, _) = Workspace::with_stream(2);
    let verified = work.isv(&["verify", "take.isv", "--backend", "auto"]).done();
    assert_eq!(verified.stdout(), b"take.isv: 2 frames verified, 2 of them by hash\n");
    let has_card = usable_gpus(&work).iter().any(|gpu| gpu["kind"] != "software");
    let notice = "working on the CPU";
    assert_eq!(verified.stderr().contains(notice), !has_card, "{}", verified.stderr());
    // Reduced resolution is not decoded on a GPU, whoever is asked.
    let reduced = work.isv(&["decode", "take.isv", "-o", "small", "--lod", "2", "--backend", "auto"]).done();
    assert!(reduced.stderr().contains("reduced resolution is decoded on the CPU"), "{}", reduced.stderr());
}

#[test]
fn a_choice_that_there_is_not_is_named() {
    let work = Workspace::new();
    work.isv(&["verify", "take.isv", "--backend", "tpu"]).fails(2, &["not one of auto, cpu, gpu"]);
}
