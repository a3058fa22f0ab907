//! Animations, read back by the decoders of other programs' formats.

use glam::DVec3;
use isv_render::{ApngWriter, Background, Camera, GifWriter, Picture, PictureRate, Style, render};
use isv_volume::TriangleMesh;
use std::io::{self, Cursor};

const RATE: PictureRate = PictureRate { pictures: 30, seconds: 1 };

/// A turntable of a tetrahedron: less than 256 colours.
fn turn(pictures: u32, background: Background) -> Vec<Picture> {
    let mesh = TriangleMesh {
        vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z],
        normals: vec![],
        triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
        appearance: None,
    };
    let camera = Camera::fitting(mesh.bounds().unwrap(), [40, 30]).in_orbit();
    let style = Style { background, normals: isv_render::NormalKind::Flat, ..Style::default() };
    let yaw = |i: u32| 360.0 * f64::from(i) / f64::from(pictures);
    (0..pictures).map(|i| render(&mesh, &camera.from_direction(yaw(i), 10.0), &style)).collect()
}

fn write_gif(pictures: &[Picture], rate: PictureRate) -> io::Result<Vec<u8>> {
    let mut file = Vec::new();
    let mut writer = GifWriter::new(&mut file, pictures[0].size(), rate)?;
    pictures.iter().try_for_each(|picture| writer.push(picture))?;
    writer.finish()?;
    Ok(file)
}

fn write_apng(pictures: &[Picture], announced: u32) -> io::Result<Vec<u8>> {
    let mut file = Vec::new();
    let mut writer = ApngWriter::new(&mut file, pictures[0].size(), announced, RATE)?;
    pictures.iter().try_for_each(|picture| writer.push(picture))?;
    writer.finish()?;
    Ok(file)
}

/// Delays in hundredths of a second, and pixels of each picture.
fn read_gif(file: &[u8]) -> Vec<(u16, Vec<u8>)> {
    let mut options = gif::DecodeOptions::new();
    options.set_color_output(gif::ColorOutput::RGBA);
    let mut decoder = options.read_info(file).unwrap();
    assert_eq!((decoder.width(), decoder.height(), decoder.repeat()), (40, 30, gif::Repeat::Infinite));
    let mut pictures = Vec::new();
    while let Some(frame) = decoder.read_next_frame().unwrap() {
        pictures.push((frame.delay, frame.buffer.to_vec()));
    }
    pictures
}

#[test]
fn a_gif_plays_back() {
    let pictures = turn(12, Background::Light);
    let read = read_gif(&write_gif(&pictures, RATE).unwrap());
    assert_eq!(read.len(), 12);
    for ((_, pixels), picture) in read.iter().zip(&pictures) {
        let worst = pixels.iter().zip(picture.rgba()).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
        assert!(worst <= 2, "{worst}: all colours fit into a palette");
        assert_eq!(&pixels[..4], Background::Light.rgba());
    }
    let delays: Vec<u16> = read.iter().map(|(delay, _)| *delay).collect();
    assert_eq!(delays[..6], [3, 4, 3, 3, 4, 3], "30 a second, without a drift");
    assert_eq!(delays.iter().sum::<u16>(), 40);
}

#[test]
fn a_gif_on_nothing_is_transparent() {
    let pictures = turn(3, Background::Transparent);
    for ((_, pixels), picture) in read_gif(&write_gif(&pictures, RATE).unwrap()).iter().zip(&pictures) {
        for (read, drawn) in pixels.chunks(4).zip(picture.rgba().chunks(4)) {
            assert_eq!(read[3], if drawn[3] < 128 { 0 } else { 255 });
        }
    }
}

#[test]
fn an_animated_png_plays_back() {
    let pictures = turn(5, Background::Transparent);
    let file = write_apng(&pictures, 5).unwrap();
    let mut reader = png::Decoder::new(Cursor::new(file)).read_info().unwrap();
    let control = *reader.info().animation_control().unwrap();
    assert_eq!((control.num_frames, control.num_plays), (5, 0));
    for picture in &pictures {
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        assert_eq!(pixels, picture.rgba());
        let frame = *reader.info().frame_control().unwrap();
        assert_eq!((frame.delay_num, frame.delay_den), (1, 30));
    }
}

#[test]
fn one_picture_is_an_animation() {
    let one = turn(1, Background::Dark);
    assert_eq!(read_gif(&write_gif(&one, RATE).unwrap()).len(), 1);
    assert!(write_apng(&one, 1).is_ok());
}

#[test]
fn what_a_format_cannot_hold_is_refused() {
    let refused = |result: io::Result<Vec<u8>>, part: &str| {
        let error = result.unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::InvalidInput);
        assert!(error.to_string().contains(part), "{error}");
    };
    let filled = |size| vec![Picture::filled(size, [9; 4])];
    refused(write_gif(&filled([70_000, 1]), RATE), "not 70000 x 1");
    refused(write_gif(&filled([0, 4]), RATE), "not 0 x 4");
    refused(write_gif(&filled([4, 4]), PictureRate { pictures: 60, seconds: 1 }), "at most 50 pictures");
    refused(write_gif(&filled([4, 4]), PictureRate { pictures: 0, seconds: 1 }), "no rate");
    refused(
        write_gif(&[filled([4, 4]), filled([4, 5])].concat(), RATE),
        "4 x 5 pixels in an animation of 4 x 4",
    );
    refused(write_apng(&filled([4, 4]), 2), "lacks 1");
    refused(write_apng(&[filled([4, 4]), filled([4, 4])].concat(), 1), "more pictures");
    refused(write_apng(&filled([4, 4]), 0), "");
    refused(write_apng(&filled([0, 4]), 1), "");
    assert!(GifWriter::new(Vec::new(), [4, 4], RATE).unwrap().finish().is_err());
}

#[test]
fn a_slow_rate_is_as_slow_as_a_file_can_say() {
    let slow = PictureRate { pictures: 1, seconds: u32::MAX };
    let read = read_gif(&write_gif(&turn(1, Background::Light), slow).unwrap());
    assert_eq!(read[0].0, u16::MAX);
}
