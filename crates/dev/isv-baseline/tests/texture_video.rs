//! Textures as video, if ffmpeg is installed.

use isv_baseline::{TextureVideo, ToolError, Tools, VideoSettings};
use isv_format::FrameRate;
use isv_testkit::{Need, skip};
use isv_volume::Image;

const FRAMES: usize = 4;

/// A coloured pattern that moves to the right; its sides are odd.
fn picture(frame: usize) -> Image {
    let [width, height] = [67, 33];
    let pixels = (0..width * height).map(|place| {
        let (x, y) = (f64::from(place % width) - 2.0 * frame as f64, f64::from(place / width));
        let wave = |phase: f64| (127.5 + 100.0 * (x / 9.0 + y / 14.0 + phase).sin()) as u8;
        [wave(0.0), wave(0.7), wave(1.4)]
    });
    Image::new(width, height, pixels.collect()).unwrap()
}

/// Mean squared error of pixels, and the bytes of the video.
fn coded(codec: &TextureVideo, crf: u8) -> (f64, usize) {
    let settings =
        VideoSettings { crf, gop: 30, frame_rate: FrameRate { numerator: 30_000, denominator: 1001 } };
    let mut encoding = codec.begin(settings).unwrap();
    for frame in 0..FRAMES {
        encoding.push(&picture(frame)).unwrap();
    }
    let run = encoding.finish().unwrap();
    assert!(run.command.contains(&format!("-crf {crf} -g 30")), "{}", run.command);
    let textures = run.output;
    assert_eq!(textures.size, [67, 33]);
    let mut pictures = codec.decode(&textures).unwrap().output;
    let mut squares = 0.0;
    for frame in 0..FRAMES {
        let (decoded, original) = (pictures.next_picture().unwrap(), picture(frame));
        let pairs = decoded.pixels().as_flattened().iter().zip(original.pixels().as_flattened());
        squares += pairs.map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2)).sum::<f64>();
    }
    assert!(pictures.next_picture().is_err(), "there are as many pictures as went in");
    (squares / (FRAMES * 67 * 33 * 3) as f64, textures.video.len())
}

#[test]
fn pictures_come_back_at_the_quality_asked_for() {
    let Some(codec) = TextureVideo::find(&Tools::default()).unwrap() else {
        return skip(Need::Media, "ffmpeg is not installed");
    };
    let [(fine, large), (coarse, small)] = [8, 40].map(|crf| coded(&codec, crf));
    assert!(fine < 30.0 && fine < coarse && small < large, "{fine} {large} {coarse} {small}");
}

#[test]
fn pictures_of_another_size_are_refused() {
    let Some(codec) = TextureVideo::find(&Tools::default()).unwrap() else {
        return skip(Need::Media, "ffmpeg is not installed");
    };
    let mut encoding =
        codec.begin(VideoSettings { crf: 30, gop: 30, frame_rate: FrameRate::DEFAULT }).unwrap();
    encoding.push(&picture(0)).unwrap();
    let error = encoding.push(&Image::new(2, 2, vec![[0; 3]; 4]).unwrap()).unwrap_err();
    assert!(matches!(error, ToolError::PictureSize { size: [2, 2], expected: [67, 33] }), "{error}");
    assert!(error.is_of_all_settings());
}
