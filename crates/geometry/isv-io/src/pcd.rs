//! PCD, the format of the Point Cloud Library: versions 0.5, 0.6 and 0.7 of its file format page. A text header names the
//! fields of a point; the body is text, binary, or binary compressed by LZF.

mod body;
mod header;
mod lzf;
mod write;

pub(crate) use body::parse;
pub(crate) use write::write;
