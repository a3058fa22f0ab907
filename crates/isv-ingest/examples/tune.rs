use isv_encode::*;
use isv_format::*;
use isv_ingest::*;
use isv_metrics::*;
use isv_surface::*;
use isv_volume::*;
use std::time::Instant;
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let name = &args[1];
    let frame: usize = args[2].parse().unwrap();
    let spacing: f64 = args[3].parse().unwrap();
    let voxel: f64 = args[4].parse().unwrap();
    let edge = args.get(5).map_or(BlockEdge::E8, |e| BlockEdge::from_voxels(e.parse().unwrap()).unwrap());
    let path = format!("/tmp/wt/shared/data/{name}/frame_{frame:04}.ply");
    let mesh = isv_io::read_mesh(std::path::Path::new(&path), isv_io::Unit::Metre).unwrap();
    let grid = Grid {
        voxel_size: VoxelSize::from_metres(voxel).unwrap(),
        edge,
        truncation: Truncation::from_voxels(8).unwrap(),
    };
    let s = MeshIngest::new(grid);
    let sign = decide_sign(&mesh, SignMode::Auto).0;
    let t = Instant::now();
    let reference = ingest_mesh(&mesh, &s, sign).unwrap();
    let t_mesh = t.elapsed();
    let samples = sample_surface(&mesh, spacing, 7);
    let mut cloud = PointCloud {
        positions: samples.iter().map(|s| s.point).collect(),
        normals: samples.iter().map(|s| s.normal).collect(),
        viewpoint: None,
    };
    let mut r = SplitMix64::new(99);
    if let Ok(v) = std::env::var("NOISE") {
        let a: f64 = v.parse().unwrap();
        for p in &mut cloud.positions {
            *p += a * (glam::DVec3::new(r.next_f64(), r.next_f64(), r.next_f64()) * 2.0 - 1.0);
        }
    }
    if let Ok(v) = std::env::var("TILT") {
        let a: f64 = v.parse::<f64>().unwrap().to_radians();
        for n in &mut cloud.normals {
            let u = (glam::DVec3::new(r.next_f64(), r.next_f64(), r.next_f64()) * 2.0 - 1.0)
                .cross(*n)
                .normalize();
            *n = *n * a.cos() + u * a.sin();
        }
    }
    if let Ok(v) = std::env::var("FLIP") {
        let a: f64 = v.parse().unwrap();
        for n in &mut cloud.normals {
            if r.next_f64() < a {
                *n = -*n;
            }
        }
    }
    if std::env::var_os("EST").is_some() {
        let given = cloud.normals.clone();
        cloud.normals.clear();
        let t = Instant::now();
        cloud = estimate_normals(&cloud).unwrap();
        println!(
            "estimated in {:?}: {} agree in sign, mean cos {:.4}",
            t.elapsed(),
            cloud.normals.iter().zip(&given).filter(|(a, b)| a.dot(**b) > 0.0).count() as f64
                / given.len() as f64,
            cloud.normals.iter().zip(&given).map(|(a, b)| a.dot(*b).abs()).sum::<f64>() / given.len() as f64
        );
    }
    let t = Instant::now();
    let (d, e) = decide_point_sign(&cloud, SignMode::Auto);
    println!("{d} ({e}) {:?}", t.elapsed());
    let mode = if std::env::var_os("OFFSET").is_some() { PointSign::Offset } else { PointSign::Oriented };
    if let Ok(n) = std::env::var("BENCH") {
        let t = Instant::now();
        for _ in 0..n.parse().unwrap() {
            std::hint::black_box(ingest_points(&cloud, &PointIngest::new(grid), mode).unwrap());
        }
        println!("{:?}", t.elapsed());
        return;
    }
    let t = Instant::now();
    let volume = ingest_points(&cloud, &PointIngest::new(grid), mode).unwrap();
    println!(
        "{} points; mesh {:.0} ms, points {:.0} ms; blocks {} {}; masks {} {}",
        cloud.positions.len(),
        t_mesh.as_secs_f64() * 1e3,
        t.elapsed().as_secs_f64() * 1e3,
        reference.block_count(),
        volume.block_count(),
        reference.unobserved_masks().values().map(|m| m.count()).sum::<usize>(),
        volume.unobserved_masks().values().map(|m| m.count()).sum::<usize>()
    );
    // field error by distance
    let index = volume.index();
    let mut bins = vec![(0usize, 0.0f64, 0.0f64, 0usize); 9];
    for (b, c) in reference.coords().iter().enumerate() {
        let Some(o) = index.get(*c) else { continue };
        for (v, (a, t)) in reference.block(b).iter().zip(volume.block(o as usize)).enumerate() {
            if reference.unobserved(b).is_some_and(|m| m.contains(v))
                || volume.unobserved(o as usize).is_some_and(|m| m.contains(v))
            {
                continue;
            }
            let d = f64::from(*a) / 256.0;
            let e = f64::from(*t) / 256.0 - d;
            let bin = &mut bins[(d.abs() as usize).min(8)];
            bin.0 += 1;
            bin.1 += e.abs();
            bin.2 = bin.2.max(e.abs());
            bin.3 += usize::from((*a < 0) != (*t < 0) && d.abs() > 0.5);
        }
    }
    if std::env::var_os("WHERE").is_some() {
        let mut at = std::collections::BTreeMap::new();
        for (b, c) in reference.coords().iter().enumerate() {
            let Some(o) = index.get(*c) else { continue };
            let mut n = [0; 3];
            for (v, (a, t)) in reference.block(b).iter().zip(volume.block(o as usize)).enumerate() {
                if volume.unobserved(o as usize).is_some_and(|m| m.contains(v)) {
                    n[2] += 1;
                    continue;
                }
                if (*a < 0) != (*t < 0) && a.abs() > 128 {
                    n[usize::from(a.abs() > 512)] += 1;
                }
            }
            if n != [0; 3] {
                at.insert((c.y, c.x, c.z), n);
            }
        }
        for (k, n) in at {
            println!("{k:?} near wrong {} far wrong {} masked {}", n[0], n[1], n[2]);
        }
    }
    if let Ok(w) = std::env::var("SLICE") {
        let w: Vec<i32> = w.split(',').map(|x| x.parse().unwrap()).collect();
        let c = BlockCoord::from([w[0], w[1], w[2]]);
        let b = reference.index().get(c).unwrap() as usize;
        let o = index.get(c).unwrap() as usize;
        for z in 0..8 {
            println!("z {z}");
            for y in 0..8 {
                for v in [&reference, &volume].into_iter().zip([b, o]) {
                    for x in 0..8 {
                        let i = (z * 8 + y) * 8 + x;
                        print!(
                            "{:6.2}{}",
                            f64::from(v.0.block(v.1)[i]) / 256.0,
                            if v.0.unobserved(v.1).is_some_and(|m| m.contains(i)) { '*' } else { ' ' }
                        );
                    }
                    print!("  |  ");
                }
                println!();
            }
        }
    }
    for (i, b) in bins.iter().enumerate() {
        if [0, 1, 2, 4, 7, 8].contains(&i) {
            println!("  {i}: {} mean {:.3} vox max {:.2} wrong sign {}", b.0, b.1 / b.0 as f64, b.2, b.3);
        }
    }
    for (label, v) in [("mesh", &reference), ("points", &volume)] {
        let header = StreamHeader {
            profile: Profile::Paper,
            grid,
            frame_rate: FrameRate { numerator: 30, denominator: 1 },
            coefficients: 64.min(edge.block_voxels() as u16),
            dc_step: 819,
            ac_step: 8192,
        };
        let mut e = Encoder::new(
            &header,
            EncoderSettings { motion: MotionMode::Fixed(Prediction::ThreeDof), ..Default::default() },
        );
        let f = e.encode(v);
        let raw = extract_surface(v, &SurfaceOptions { normals: false });
        let coded = extract_surface(e.reconstruction().unwrap(), &SurfaceOptions { normals: false });
        let o = CompareOptions { spacing_m: 0.005, seed: 1 };
        let (g, h) = (compare(&mesh, &raw, &o), compare(&mesh, &coded, &o));
        println!("{label}: {} B (blocks {})", f.bytes_blocks() + f.bytes_coefficients(), f.bytes_blocks());
        for (l, g) in [("raw", g), ("coded", h)] {
            if let Ok(g) = g {
                println!(
                    "   {l}: p2s {:.3} rms {:.3} p99 {:.2} r2t {:.3} t2r {:.3} haus {:.1} area {:.3} comps {}/{}",
                    g.p2s_mean_mm,
                    g.p2s_rms_mm,
                    g.p2s_p99_mm,
                    g.ref_to_test_mean_mm,
                    g.test_to_ref_mean_mm,
                    g.hausdorff_mm,
                    g.area_ratio,
                    g.components_test,
                    g.components_ref
                );
            }
        }
        for (l, m) in [("raw", raw), ("coded", coded)] {
            isv_io::write_mesh(
                std::path::Path::new(&format!("/tmp/points_out/{name}_{label}_{l}.ply")),
                &m,
                isv_io::Format::Ply,
            )
            .unwrap();
        }
    }
}
