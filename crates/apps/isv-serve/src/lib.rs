//! Streams to browsers: the player's page, `.isv` files with ranges, and packets as they are made.
//!
//! ```text
//! a pipe, a growing file, a folder ── Source ─> Hub ─ Viewer ─┐
//!                                                             ├─> Server ─> browsers
//!                       .isv files ── StreamFiles ────────────┤
//!                       player/    ── Page ───────────────────┘
//! ```
//!
//! | URL | what |
//! |---|---|
//! | `/` and the paths of `player/` | the page and its modules, embedded at compile time |
//! | `/files/N/NAME.isv` | the files given, with HTTP ranges |
//! | `/streams.json` | the names of what is served, for the page to offer |
//! | `/live` | a WebSocket with the packets of a live source, as [`message`] has them |
//!
//! It reads packets, and decodes none. What a viewer can make the server hold does not grow. All viewers read
//! one ring, and whoever is too slow for it goes on at a later keyframe. The socket of a viewer holds a copy of the packet
//! that is sent, and keeps that room until the viewer leaves.

mod accept;
mod error;
mod export;
mod files;
mod guard;
mod hub;
mod live;
pub mod message;
mod page;
mod policy;
mod range;
mod server;
mod source;
mod stall;
mod token_bucket;
mod url;

pub use error::ServeError;
pub use export::{ExportError, ExportFolder};
pub use files::StreamFiles;
pub use guard::{Origin, ParseOriginError};
pub use hub::{Held, Hub, HubLimits, Viewer};
pub use live::LiveLimits;
pub use page::{Page, PageOptions};
pub use server::{Server, Settings};
pub use source::{Feed, Source};
