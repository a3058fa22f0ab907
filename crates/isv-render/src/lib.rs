//! Pictures of meshes, drawn in software: for looking at captures, comparing codecs and README files.
//!
//! A [`Camera`] looks at a box from a direction, so a sequence seen through one camera holds still. Surfaces are
//! coloured by their world normal, in which dents, seams and noise stand out, and darkened in creases; faces seen from
//! their back, which a clean mesh never shows, get a colour of their own.
//!
//! ```
//! use isv_render::{Camera, Style, render};
//! use isv_volume::TriangleMesh;
//!
//! let mesh = TriangleMesh {
//!     vertices: vec![[0.0, 0.0, 0.0].into(), [1.0, 0.0, 0.0].into(), [0.0, 1.0, 0.0].into()],
//!     normals: vec![],
//!     triangles: vec![[0, 1, 2]],
//! };
//! let camera = Camera::fitting(mesh.bounds().unwrap(), [64, 64]);
//! let picture = render(&mesh, &camera, &Style::default());
//! let mut file = Vec::new();
//! picture.write_png(&mut file)?;
//! # Ok::<(), std::io::Error>(())
//! ```
//!
//! It does not do textures, transparency, lights or shadows.

mod animation;
mod camera;
mod colour_bar;
mod draw;
mod error_scale;
mod normals;
mod occlusion;
mod palette;
mod picture;
mod raster;
mod style;
mod text;

pub use animation::{ApngWriter, GifWriter, PictureRate};
pub use camera::Camera;
pub use colour_bar::colour_bar;
pub use draw::{ErrorPicture, SeenErrors, render, render_errors};
pub use error_scale::{BEYOND_RANGE, ErrorScale};
pub use picture::{Picture, contact_sheet};
pub use style::{BACK_FACE, Background, Shading, Style};
pub use text::text_line;
