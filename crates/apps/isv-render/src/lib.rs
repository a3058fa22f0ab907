//! Pictures of meshes, drawn in software: for looking at captures, comparing codecs and README files.
//!
//! A [`Camera`] looks at a box from a direction, so a sequence seen through one camera holds still.
//! [`render`] colours surfaces as [`Shading`] says. It shows their world normal, in which dents, seams and
//! noise stand out, a grey in soft light, or the mesh's own colour. Own colours are textures and vertex
//! colours, with or without light. [`render_errors`] colours them by any error that a closure gives for a
//! point, on an [`ErrorScale`] with its [`colour_bar`].
//!
//! A [`Picture`] is a PNG file, a part of a [`contact_sheet`], or one of an animation: [`GifWriter`] or [`ApngWriter`].
//! Pixels have the same values for any number of threads. This crate reads no files and measures no distances.
//!
//! ```
//! use isv_render::{Background, Camera, ErrorScale, Style, colour_bar, render, render_errors};
//! use isv_volume::TriangleMesh;
//!
//! let mesh = TriangleMesh {
//!     vertices: vec![[0.0, 0.0, 0.0].into(), [1.0, 0.0, 0.0].into(), [0.0, 1.0, 0.0].into()],
//!     normals: vec![],
//!     appearance: None,
//!     triangles: vec![[0, 1, 2]],
//! };
//! let camera = Camera::fitting(mesh.bounds().unwrap(), [64, 64]);
//! let picture = render(&mesh, &camera, &Style::default());
//! let mut file = Vec::new();
//! picture.write_png(&mut file)?;
//!
//! // Distances from the plane z = 0.001, on a scale that ends at 2 mm.
//! let scale = ErrorScale::new(0.002).expect("a range above 0");
//! let drawn = render_errors(&mesh, &camera, &Style::default(), &scale, |point| (point.z - 0.001).abs());
//! assert!((drawn.seen.expect("the mesh is seen").mean_m - 0.001).abs() < 1e-6);
//! let with_bar = drawn.picture.above(&colour_bar(&scale, 64, Background::Light));
//! # let _ = with_bar;
//! # Ok::<(), std::io::Error>(())
//! ```
//!
//! It does not do transparency, lights of a scene or shadows.

mod animation;
mod camera;
mod colour_bar;
mod draw;
mod error_scale;
mod extent;
mod file;
mod normals;
mod occlusion;
mod palette;
mod picture;
mod raster;
mod setup;
mod style;
mod text;

pub use animation::{ApngWriter, GifWriter, PictureRate};
pub use camera::Camera;
pub use colour_bar::colour_bar;
pub use draw::{ErrorPicture, SeenErrors, render, render_errors};
pub use error_scale::{BEYOND_RANGE, ErrorScale};
pub use extent::{Extent, View};
pub use file::{PictureFile, PictureFormat};
pub use picture::{Picture, contact_sheet};
pub use setup::RenderSetup;
pub use style::{BACK_FACE, Background, GREY, NormalKind, Shading, Style};
pub use text::{text_fits, text_line};
