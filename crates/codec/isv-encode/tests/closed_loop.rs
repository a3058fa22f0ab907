//! What the encoder reconstructs is what the decoder decodes, for every prediction, block edge and number of threads.

mod support;

use isv_decode::volume_hash;
use isv_encode::{Encoder, EncoderSettings, FrameCoder, FrameWriter, MotionMode, surface_rms_voxels};
use isv_format::{PaperParameters, Prediction, Profile};
use support::{ball, decode, encode, header};

fn settings(motion: MotionMode) -> EncoderSettings {
    EncoderSettings { motion, gop: 4, checksums: true, ..EncoderSettings::default() }
}

#[test]
fn decoder_agrees_with_the_encoders_reconstruction() {
    for (edge, truncation, coefficients) in [(8, 8, 64), (4, 3, 20), (16, 16, 200), (8, 8, 512), (8, 2, 1)] {
        let header = header(edge, truncation, coefficients);
        let volumes: Vec<_> = (0..6).map(|t| ball(header.grid, f64::from(t))).collect();
        for motion in Prediction::ALL.map(MotionMode::Fixed).into_iter().chain([MotionMode::Auto]) {
            let (bytes, hashes) = encode(&header, settings(motion), &volumes);
            let (decoded, end) = decode(&bytes);
            end.unwrap();
            let found: Vec<u64> = decoded.iter().map(volume_hash).collect();
            assert_eq!(found, hashes, "edge {edge}, {motion:?}");
            for (source, decoded) in volumes.iter().zip(&decoded) {
                assert_eq!(source.coords(), decoded.coords());
                assert_eq!(source.unobserved_masks(), decoded.unobserved_masks());
            }
        }
    }
}

#[test]
fn small_steps_and_all_coefficients_are_nearly_lossless() {
    let mut header = header(8, 8, 512);
    header.profile = Profile::Paper(PaperParameters { coefficients: 512, dc_step: 16, ac_step: 16 });
    let volumes: Vec<_> = (0..3).map(|t| ball(header.grid, f64::from(t))).collect();
    let (bytes, _) = encode(&header, settings(MotionMode::Fixed(Prediction::ThreeDof)), &volumes);
    for (source, decoded) in volumes.iter().zip(&decode(&bytes).0) {
        let worst = source.samples().zip(decoded.samples()).map(|(a, b)| a.abs_diff(b)).max().unwrap();
        let rms = surface_rms_voxels(source, decoded);
        println!("worst {worst} codes, surface rms {rms:.4} voxels");
        assert!(worst <= 12 && rms < 0.01);
    }
}

#[test]
fn better_prediction_takes_fewer_bytes() {
    let header = header(8, 8, 64);
    let volumes: Vec<_> = (0..4).map(|t| ball(header.grid, f64::from(t))).collect();
    let size = |p| encode(&header, settings(MotionMode::Fixed(p)), &volumes).0.len();
    let [none, zero, translation] =
        [Prediction::None, Prediction::ZeroMotion, Prediction::ThreeDof].map(size);
    println!("none {none}, zero-motion {zero}, 3-DoF {translation} bytes");
    assert!(translation < zero && zero < none);
}

#[test]
fn bytes_do_not_depend_on_the_number_of_threads() {
    let header = header(8, 8, 64);
    let volumes: Vec<_> = (0..3).map(|t| ball(header.grid, f64::from(t))).collect();
    let settings = EncoderSettings { slices: Some(3), ..settings(MotionMode::Fixed(Prediction::SixDof)) };
    let with_threads = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| encode(&header, settings, &volumes).0)
    };
    let one = with_threads(1);
    assert!(one == with_threads(2) && one == with_threads(5), "streams differ");
    let decoded = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap().install(|| decode(&one));
    decoded.1.unwrap();
    assert_eq!(decoded.0, decode(&one).0);
}

#[test]
fn symbols_can_be_written_when_all_frames_are_coded() {
    let header = header(8, 8, 64);
    let volumes: Vec<_> = (0..6).map(|t| ball(header.grid, f64::from(t))).collect();
    for motion in [MotionMode::Fixed(Prediction::SixDof), MotionMode::Auto] {
        let mut coder = FrameCoder::on_cpu(&header, settings(motion));
        let coded: Vec<_> = volumes.iter().map(|volume| coder.code(volume).unwrap()).collect();
        let mut writer = FrameWriter::default();
        let mut encoder = Encoder::new(&header, settings(motion));
        for (coded, volume) in coded.into_iter().zip(&volumes) {
            let (late, in_turn) = (writer.write(coded), encoder.encode(volume));
            assert_eq!(
                (late.keyframe, late.payload().to_bytes()),
                (in_turn.keyframe, in_turn.payload().to_bytes())
            );
        }
    }
}

#[test]
fn an_empty_frame_and_a_frame_after_it_are_coded() {
    let header = header(8, 8, 64);
    let empty = isv_volume::SparseVolume::empty(header.grid);
    let volumes = [empty.clone(), ball(header.grid, 0.0), empty, ball(header.grid, 1.0)];
    for motion in [MotionMode::Fixed(Prediction::SixDof), MotionMode::Auto] {
        let (bytes, hashes) = encode(&header, settings(motion), &volumes);
        let (decoded, end) = decode(&bytes);
        end.unwrap();
        assert_eq!(decoded.iter().map(volume_hash).collect::<Vec<_>>(), hashes);
    }
}
