//! Images of textures, as other programs write them, whole and broken.

use isv_io::{ImageFault, MAX_IMAGE_SIDE, decode_image};
use isv_testfiles::image::{self, SIDE, gradient, gradients, png, png_of_size};
use png::{BitDepth, ColorType};

#[test]
fn every_format_shows_the_same_picture() {
    for (name, bytes, tolerance) in gradients() {
        let image = decode_image(&bytes, name).unwrap();
        assert_eq!((image.width(), image.height()), (SIDE, SIDE), "{name}");
        for (index, pixel) in (0..).zip(image.pixels()) {
            let expected = gradient(index % SIDE, index / SIDE);
            let error = (0..3).map(|channel| pixel[channel].abs_diff(expected[channel])).max().unwrap();
            assert!(error <= tolerance, "{name}: {pixel:?} is not {expected:?} at {index}");
        }
    }
}

#[test]
fn grey_palettes_few_bits_and_sixteen_become_rgb() {
    let pixels = |colour, depth, samples: &[u8]| {
        decode_image(&png(2, colour, depth, samples), "a.png").unwrap().pixels().to_vec()
    };
    assert_eq!(pixels(ColorType::Grayscale, BitDepth::Eight, &[7, 200]), [[7; 3], [200; 3]]);
    assert_eq!(pixels(ColorType::Grayscale, BitDepth::One, &[0b0100_0000]), [[0; 3], [255; 3]]);
    assert_eq!(pixels(ColorType::GrayscaleAlpha, BitDepth::Eight, &[7, 0, 9, 255]), [[7; 3], [9; 3]]);
    assert_eq!(pixels(ColorType::Indexed, BitDepth::Two, &[0b0111_0000]), [[0, 255, 0], [9, 8, 7]]);
    // 0x7f80 is 127.502 of 255.
    assert_eq!(pixels(ColorType::Grayscale, BitDepth::Sixteen, &[0x7f, 0x80, 0, 0x80]), [[127; 3], [0; 3]]);
    let grey = decode_image(image::GREY_JPEG, "grey.jpg").unwrap();
    assert!(grey.pixels().iter().all(|[red, green, blue]| red == green && green == blue));
}

#[test]
fn what_is_too_large_is_refused_by_its_header() {
    let fault = |bytes: &[u8]| decode_image(bytes, "a.png").unwrap_err().fault;
    for (width, height) in [(MAX_IMAGE_SIDE + 1, 1), (1, u32::MAX >> 1), (9000, 9000)] {
        let size = ImageFault::Size { width: width.into(), height: height.into() };
        assert_eq!(fault(&png_of_size(width, height)), size);
    }
    assert!(matches!(fault(&png_of_size(8192, 8192)), ImageFault::Dense { .. }));
    let resized = |bytes: &[u8], at: usize, sides: &[u8]| {
        let mut bytes = bytes.to_vec();
        bytes[at..at + sides.len()].copy_from_slice(sides);
        fault(&bytes)
    };
    // Height before width, behind the marker of the frame, its length and its precision.
    let at = image::JPEG.windows(2).position(|marker| marker == [0xff, 0xc0]).unwrap() + 5;
    assert!(matches!(resized(image::JPEG, at, &[0xff; 4]), ImageFault::Size { .. }));
    assert!(matches!(
        resized(image::LOSSY_WEBP, 26, &[0xff; 4]),
        ImageFault::Dense { .. } | ImageFault::Size { .. }
    ));
    assert!(matches!(resized(image::ETC1S_KTX2, 20, &[0xff; 8]), ImageFault::Size { .. }));
    assert!(matches!(resized(image::ETC1S_KTX2, 20, &[0, 32, 0, 0, 0, 32, 0, 0]), ImageFault::Dense { .. }));
    assert!(matches!(resized(image::UASTC_KTX2, 96, &[0xff; 8]), ImageFault::Damaged { .. }));
}

#[test]
fn what_cannot_be_read_says_so_in_one_sentence() {
    let message = |bytes: &[u8]| decode_image(bytes, "skin").unwrap_err().to_string();
    assert_eq!(message(b""), "image `skin`: not a PNG, JPEG, WebP or KTX2 image");
    let astc = "image `skin`: KTX2 that is neither ETC1S nor UASTC cannot be read; save it as PNG or JPEG";
    assert_eq!(message(image::ASTC_KTX2), astc);
    let mut layers = image::ETC1S_KTX2.to_vec();
    layers[32] = 4;
    assert!(message(&layers).contains("a KTX2 file of several images cannot be read"));
}

#[test]
fn cut_images_are_refused() {
    for (name, bytes, _) in gradients() {
        for length in (0..bytes.len() - 2).step_by(7) {
            let error = match decode_image(&bytes[..length], name) {
                Err(error) => error.to_string(),
                // Mip levels and bytes behind the pixels may be missing.
                Ok(image) => {
                    assert_eq!(image.pixels().len(), 256, "{name} cut at {length}");
                    continue;
                }
            };
            assert!(error.starts_with(&format!("image `{name}`: ")) && !error.contains('\n'), "{error}");
        }
        let half = decode_image(&bytes[..bytes.len() / 2], name);
        assert!(half.is_err(), "{name}: half of it is no image");
    }
}

#[test]
fn damaged_images_never_panic() {
    let mut random = isv_volume::SplitMix64::new(5);
    for (name, bytes, _) in gradients() {
        for _ in 0..200 {
            let mut bytes = bytes.clone();
            for _ in 0..1 + random.next_u64() % 4 {
                let at = random.next_u64() as usize % bytes.len();
                bytes[at] = random.next_u64() as u8;
            }
            if let Err(error) = decode_image(&bytes, name) {
                assert!(!error.to_string().contains('\n'), "{error}");
            }
        }
    }
}
