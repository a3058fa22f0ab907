//! Shapes, scenes, random numbers and real captures, for tests and for the conformance streams. Never linked into anything that ships.

mod captures;
mod depth_camera;
mod meshes;
mod needs;
mod random;
mod scenes;
mod volumes;

pub use captures::capture;
pub use depth_camera::{camera_ring, look_at, render_colours, render_depth};
pub use meshes::{cube, finer, open_box, sheet, soup, sphere};
pub use needs::{Need, skip};
pub use random::Random;
pub use scenes::{street, waves};
pub use volumes::{ball, small_ball, still_and_moving_ball, volume_of};
