#![allow(missing_docs)]
use glam::*;
use isv_encode::*;
use isv_format::*;
use isv_fusion::*;
use isv_metrics::*;
use isv_spatial::Bvh;
use isv_surface::*;
use isv_testkit::*;
use isv_volume::*;
use std::path::Path;
fn env(name: &str, default: f64) -> f64 {
    std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(default)
}
fn grid(v: f64) -> Grid {
    Grid {
        voxel_size: VoxelSize::from_metres(v).unwrap(),
        edge: BlockEdge::E8,
        truncation: Truncation::from_voxels(8).unwrap(),
    }
}
fn header(v: f64) -> StreamHeader {
    let k = 0.005 / v;
    StreamHeader {
        profile: Profile::Paper,
        grid: grid(v),
        frame_rate: FrameRate { numerator: 30, denominator: 1 },
        coefficients: 64,
        dc_step: (819.0 * k) as u32,
        ac_step: (8192.0 * k) as u32,
    }
}
fn settings(v: f64) -> FusionSettings {
    let mut s = FusionSettings::new(grid(v));
    s.noise = env("NOISE", s.noise);

    s
}
fn components(mesh: &TriangleMesh) -> Vec<usize> {
    let mut p: Vec<usize> = (0..mesh.vertices.len()).collect();
    fn f(p: &mut [usize], mut i: usize) -> usize {
        while p[i] != i {
            p[i] = p[p[i]];
            i = p[i];
        }
        i
    }
    for t in &mesh.triangles {
        for k in 1..3 {
            let (a, b) = (f(&mut p, t[0] as usize), f(&mut p, t[k] as usize));
            p[a] = b;
        }
    }
    let mut n = std::collections::HashMap::new();
    for t in &mesh.triangles {
        *n.entry(f(&mut p, t[0] as usize)).or_insert(0) += 1;
    }
    let mut v: Vec<usize> = n.into_values().collect();
    v.sort();
    v.reverse();
    v
}
fn rig() {
    let lens = Intrinsics {
        width: 640,
        height: 576,
        focal: DVec2::splat(504.0),
        principal: DVec2::new(319.5, 287.5),
    };
    let v = env("VOXEL", 0.005);
    let mut enc = Encoder::new(&header(v), EncoderSettings::default());
    let n = env("FRAMES", 1.0) as usize;
    for f in 0..n {
        let mesh = isv_io::read_mesh(
            Path::new(&format!("/tmp/wt/shared/data/dancer/frame_{f:04}.ply")),
            isv_io::Unit::Metre,
        )
        .unwrap();
        let images: Vec<_> = camera_ring(mesh.bounds().unwrap(), &lens)
            .iter()
            .map(|p| render_depth(&mesh, &lens, p))
            .collect();
        let t = std::time::Instant::now();
        let volume = fuse(&images, &settings(v)).unwrap();
        let ms = t.elapsed().as_millis();
        let frame = enc.encode(&volume);
        if env("DBG", 0.0) > 0.0 {
            let rec = enc.reconstruction().unwrap();
            let mut h = std::collections::BTreeMap::new();
            let mut shown = 0;
            for b in 0..volume.block_count() {
                let flips: Vec<usize> = (0..512)
                    .filter(|i| {
                        !volume.unobserved(b).is_some_and(|m| m.contains(*i))
                            && (volume.block(b)[*i] < 0) != (rec.block(b)[*i] < 0)
                            && volume.block(b)[*i].abs() > env("FL", 256.0) as i16
                    })
                    .collect();
                for i in &flips {
                    *h.entry(volume.block(b)[*i] / 32).or_insert(0) += 1;
                }
                if flips.len() > 3 && shown < 4 {
                    shown += 1;
                    println!(
                        "block {:?} masked {} flips {}",
                        volume.coords()[b],
                        volume.unobserved(b).map_or(0, |m| m.count()),
                        flips.len()
                    );
                    let z = flips[0] / 64;
                    for y in 0..8 {
                        println!(
                            "{:?}   {:?}",
                            (0..8)
                                .map(|x| {
                                    let i = z * 64 + y * 8 + x;
                                    format!(
                                        "{:5}{}",
                                        volume.block(b)[i],
                                        if volume.unobserved(b).is_some_and(|m| m.contains(i)) {
                                            "*"
                                        } else {
                                            " "
                                        }
                                    )
                                })
                                .collect::<String>(),
                            (0..8)
                                .map(|x| format!("{:5}", rec.block(b)[z * 64 + y * 8 + x]))
                                .collect::<String>()
                        );
                    }
                }
            }
            println!("flips {h:?}");
        }
        let raw = extract_surface(&volume, &SurfaceOptions::default());
        let coded = extract_surface(enc.reconstruction().unwrap(), &SurfaceOptions::default());
        let seen: Vec<DVec3> = sample_surface(&mesh, 0.005, 1)
            .iter()
            .filter(|s| {
                images.iter().any(|im| {
                    let (pose, l) = (im.pose(), im.intrinsics());
                    let c = pose.to_camera(s.point);
                    let uv = l.project(c).round();
                    let dir = (pose.centre - s.point).normalize();
                    if uv.x < 0.0 || uv.y < 0.0 || uv.x >= l.width as f64 || uv.y >= l.height as f64 {
                        return false;
                    }
                    dir.dot(s.normal).abs() > 0.174
                        && im
                            .depth_m(uv.x as u32, uv.y as u32)
                            .is_some_and(|d| (d as f64 - c.z).abs() < 0.005)
                })
            })
            .map(|s| s.point)
            .collect();
        let src = Bvh::new(&mesh);
        if env("DBG", 0.0) > 0.0 {
            let mut shown = 0;
            for t in &coded.triangles {
                let p = coded.vertices[t[0] as usize];
                if shown < 6 && src.closest_point(p).distance_sq.sqrt() > 0.02 {
                    shown += 1;
                    let q = (p / v - 0.5).floor().as_ivec3();
                    let c = q.div_euclid(IVec3::splat(8));
                    let l = q.rem_euclid(IVec3::splat(8));
                    let Some(b) = volume.index().get(BlockCoord::from(c.to_array())) else {
                        println!("none");
                        continue;
                    };
                    let b = b as usize;
                    let rec = enc.reconstruction().unwrap();
                    println!(
                        "block {:?} masked {} at {l}, dist {}",
                        volume.coords()[b],
                        volume.unobserved(b).map_or(0, |m| m.count()),
                        src.closest_point(p).distance_sq.sqrt()
                    );
                    for y in 0..8 {
                        println!(
                            "{:?}   {:?}",
                            (0..8)
                                .map(|x| {
                                    let i = (l.z * 64 + y * 8 + x) as usize;
                                    format!(
                                        "{:5}{}",
                                        volume.block(b)[i],
                                        if volume.unobserved(b).is_some_and(|m| m.contains(i)) {
                                            "*"
                                        } else {
                                            " "
                                        }
                                    )
                                })
                                .collect::<String>(),
                            (0..8)
                                .map(|x| format!("{:5}", rec.block(b)[(l.z * 64 + y * 8 + x) as usize]))
                                .collect::<String>()
                        );
                    }
                }
            }
        }
        let stat = |m: &TriangleMesh| {
            let d = distances_to_surface(&seen, &Bvh::new(m));
            let back = distances_to_surface(
                &sample_surface(m, 0.005, 2).iter().map(|s| s.point).collect::<Vec<_>>(),
                &src,
            );
            let mean = |d: &[f64]| 1000.0 * d.iter().sum::<f64>() / d.len() as f64;
            let p = |d: &[f64], q: f64| {
                let mut d = d.to_vec();
                d.sort_by(f64::total_cmp);
                1000.0 * d[((d.len() - 1) as f64 * q) as usize]
            };
            let c = components(m);
            format!(
                "s2t {:.3} p99 {:.2} max {:.1} | t2s {:.3} p99 {:.2} max {:.1} | comps {} {:?}",
                mean(&d),
                p(&d, 0.99),
                p(&d, 1.0),
                mean(&back),
                p(&back, 0.99),
                p(&back, 1.0),
                c.len(),
                &c[..c.len().min(4)]
            )
        };
        println!(
            "f{f} {ms} ms, blocks {} masks {} ({} vox); bytes b {} m {} c {}; seen {}",
            volume.block_count(),
            volume.unobserved_masks().len(),
            volume.unobserved_masks().values().map(VoxelMask::count).sum::<usize>(),
            frame.bytes_blocks(),
            frame.bytes_motion(),
            frame.bytes_coefficients(),
            seen.len()
        );
        println!("  raw   {}", stat(&raw));
        println!("  coded {}", stat(&coded));
        if f == 0 {
            isv_io::write_mesh(Path::new("/tmp/fus_rig.ply"), &coded, isv_io::Format::Ply).unwrap();
            isv_io::write_mesh(Path::new("/tmp/fus_rig_raw.ply"), &raw, isv_io::Format::Ply).unwrap();
        }
    }
}
fn load_room(f: usize) -> DepthImage {
    let d = "/tmp/wt/shared/data/room_rgbd";
    let j: serde_json::Value =
        serde_json::from_slice(&std::fs::read(format!("{d}/camera.json")).unwrap()).unwrap();
    let m: Vec<f64> = j["poses"][f]
        .as_array()
        .unwrap()
        .iter()
        .flat_map(|r| r.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()))
        .collect();
    let m = DMat4::from_cols_array(&m.try_into().unwrap()).transpose();
    let lens = Intrinsics {
        width: 640,
        height: 480,
        focal: DVec2::splat(585.0),
        principal: DVec2::new(320.0, 240.0),
    };
    let mut r = png::Decoder::new(std::io::BufReader::new(
        std::fs::File::open(format!("{d}/depth/frame_{f:04}.png")).unwrap(),
    ))
    .read_info()
    .unwrap();
    let mut b = vec![0; r.output_buffer_size().unwrap()];
    r.next_frame(&mut b).unwrap();
    let depths = b
        .chunks_exact(2)
        .map(|c| {
            let v = u16::from_be_bytes([c[0], c[1]]);
            if v == 65535 { 0.0 } else { v as f32 * 0.001 }
        })
        .collect();
    DepthImage::new(lens, CameraPose::from_matrix(m).unwrap(), depths).unwrap()
}
fn points(im: &DepthImage, step: usize) -> Vec<DVec3> {
    let w = im.intrinsics().width as usize;
    im.depths_m()
        .iter()
        .enumerate()
        .filter(|(i, d)| i % step == 0 && **d > 0.0)
        .map(|(i, d)| {
            im.pose()
                .to_world(im.intrinsics().unproject(DVec2::new((i % w) as f64, (i / w) as f64), *d as f64))
        })
        .collect()
}
fn room() {
    let v = env("VOXEL", 0.01);
    let acc = env("ACC", 0.0) > 0.0;
    let (n, step) = (env("FRAMES", 2.0) as usize, env("STRIDE", 10.0) as usize);
    let mut enc = Encoder::new(&header(v), EncoderSettings::default());
    let mut accum = Accumulator::new(settings(v));
    let mut all: Vec<DVec3> = vec![];
    let (mut bytes, mut cov, mut fp) = (vec![], vec![], vec![]);
    for k in 0..n {
        let f = k * step;
        let im = load_room(f);
        let t = std::time::Instant::now();
        let volume = if acc {
            accum.integrate(std::slice::from_ref(&im)).unwrap();
            accum.volume()
        } else {
            fuse(std::slice::from_ref(&im), &settings(v)).unwrap()
        };
        let ms = t.elapsed().as_millis();
        let t = std::time::Instant::now();
        let frame = enc.encode(&volume);
        let ems = t.elapsed().as_millis();
        let mesh = extract_surface(enc.reconstruction().unwrap(), &SurfaceOptions::default());
        let b = frame.bytes_blocks() + frame.bytes_motion() + frame.bytes_coefficients();
        print!(
            "f{f} {ms} ms enc {ems}, blocks {} masks {} ({} vox); bytes {b} = b {} m {} c {}",
            volume.block_count(),
            volume.unobserved_masks().len(),
            volume.unobserved_masks().values().map(VoxelMask::count).sum::<usize>(),
            frame.bytes_blocks(),
            frame.bytes_motion(),
            frame.bytes_coefficients()
        );
        bytes.push(b as f64);
        if !acc {
            all.clear();
        }
        all.extend(points(&im, 1));
        if k % (env("EVAL", 1.0) as usize) == 0 || k == n - 1 {
            let q: Vec<DVec3> = if acc {
                all.iter().step_by(1 + all.len() / 30000).copied().collect()
            } else {
                points(&im, 13)
            };
            let d = distances_to_surface(&q, &Bvh::new(&mesh));
            let c = d.iter().filter(|d| **d <= 0.05).count() as f64 / d.len() as f64;
            // surface to readings: brute grid
            let mut cells: std::collections::HashMap<[i32; 3], Vec<DVec3>> = Default::default();
            for p in &all {
                let e = cells.entry((*p / 0.03).floor().as_ivec3().to_array()).or_default();
                if e.len() < 4000 {
                    e.push(*p);
                }
            }
            let s = sample_surface(&mesh, 0.02, 3);
            let far = s
                .iter()
                .filter(|s| {
                    let c = (s.point / 0.03).floor().as_ivec3();
                    !(0..27).any(|i| {
                        cells
                            .get(&(c + IVec3::new(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1)).to_array())
                            .is_some_and(|v| v.iter().any(|p| p.distance_squared(s.point) <= 0.0009))
                    })
                })
                .count() as f64
                / s.len() as f64;
            let mut dd = d.clone();
            dd.sort_by(f64::total_cmp);
            let co = components(&mesh);
            print!(
                "; cover {:.4} far {:.5} median {:.2} mean {:.2} mm comps {} {:?} small {}",
                c,
                far,
                dd[dd.len() / 2] * 1e3,
                dd.iter().map(|d| d.min(0.05)).sum::<f64>() / dd.len() as f64 * 1e3,
                co.len(),
                &co[..co.len().min(4)],
                co.iter().filter(|n| **n < 30).count()
            );
            cov.push(c);
            fp.push(far);
        }
        println!();
        if k == 0 || k == n - 1 {
            isv_io::write_mesh(
                Path::new(&format!("/tmp/fus_room{}_{k}.ply", if acc { "acc" } else { "" })),
                &mesh,
                isv_io::Format::Ply,
            )
            .unwrap();
        }
    }
    println!(
        "total {} key {} mean P {:.0}; worst cover {:.4}, far {:.5}",
        bytes.iter().sum::<f64>(),
        bytes[0],
        bytes[1..].iter().sum::<f64>() / (bytes.len() - 1).max(1) as f64,
        cov.iter().fold(1.0f64, |a, b| a.min(*b)),
        fp.iter().fold(0.0f64, |a, b| a.max(*b))
    );
}
fn main() {
    if std::env::args().nth(1).as_deref() == Some("rig") { rig() } else { room() }
}
