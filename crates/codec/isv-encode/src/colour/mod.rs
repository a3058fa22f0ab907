//! Colour on decoded surfaces: from colours seen near a surface to the colour part of its frame.
//!
//! ```text
//! ColourSample ─ target: samples that read back as what was seen ─ motion_search ─> modes
//!                                                                                  │
//!        InterPredictor, reconstruct_intra (isv-decode) ─ quantizer ─> ColourSymbols ─ syntax ─> ColourPayload
//! ```

mod encoder;
mod landing;
mod motion_search;
mod quantizer;
mod refresh;
mod syntax;
mod target;

pub use encoder::{ColourEncoder, ColourSettings, EncodedColour};
pub use landing::locate;
pub use motion_search::ColourSearch;
pub use target::ColourTarget;
