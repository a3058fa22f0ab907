//! The commands: arguments and a `run` each.

pub(crate) mod backends;
pub(crate) mod compare;
pub(crate) mod cut;
pub(crate) mod decode;
pub(crate) mod demo;
pub(crate) mod demux;
pub(crate) mod encode;
pub(crate) mod eval;
pub(crate) mod export_player;
pub(crate) mod info;
pub(crate) mod join;
pub(crate) mod mux;
pub(crate) mod package;
pub(crate) mod render;
pub(crate) mod repair;
pub(crate) mod serve;
pub(crate) mod verify;
pub(crate) mod view;
