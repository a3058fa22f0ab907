//! Buffer views compressed by meshoptimizer: `EXT_meshopt_compression` and `KHR_meshopt_compression`.

use super::fault::GltfFault;
use super::limit::Limit;
use super::schema::Meshopt;
use crate::error::quote;
use isv_foreign::catch_panic;
use meshoptimizer_rs::codec::{
    decode_filter_color, decode_filter_exp, decode_filter_oct, decode_filter_quat, decode_index_buffer,
    decode_index_sequence, decode_vertex_buffer,
};
use meshoptimizer_rs::{Error, Limits, Workspace};

/// The mode of interleaved attributes, whose stride is that of the view.
pub(super) const ATTRIBUTES: &str = "ATTRIBUTES";

/// Decodes a view from its compressed bytes.
pub(super) fn decode(view: &Meshopt, source: &[u8], limit: &Limit) -> Result<Vec<u8>, GltfFault> {
    let Meshopt { count, byte_stride: stride, .. } = *view;
    // Asked before anything is allocated, so that the library needs no limits of its own.
    limit.take_decompressed(count, stride)?;
    if count == 0 {
        return Ok(Vec::new());
    }
    let mut workspace = Workspace::new(Limits { max_bytes: usize::MAX, max_work: u64::MAX });
    let decode = match view.mode.as_str() {
        ATTRIBUTES => decode_vertex_buffer,
        "TRIANGLES" => decode_index_buffer,
        "INDICES" => decode_index_sequence,
        mode => return Err(failed(format!("the mode {} is not known", quote(mode.as_bytes())))),
    };
    type Filter = fn(&mut [u8], usize, usize, &mut Workspace) -> Result<(), Error>;
    let filter: Option<Filter> = match view.filter.as_deref() {
        None | Some("NONE") => None,
        Some("OCTAHEDRAL") => Some(decode_filter_oct),
        Some("QUATERNION") => Some(decode_filter_quat),
        Some("EXPONENTIAL") => Some(decode_filter_exp),
        Some("COLOR") => Some(decode_filter_color),
        Some(filter) => return Err(failed(format!("the filter {} is not known", quote(filter.as_bytes())))),
    };
    let decoded = catch_panic(|| {
        let mut bytes = decode(count, stride, source, &mut workspace)?;
        if let Some(filter) = filter {
            filter(&mut bytes, count, stride, &mut workspace)?;
        }
        Ok(bytes)
    });
    match decoded {
        Some(decoded) => decoded.map_err(|error: Error| failed(error.to_string())),
        None => Err(failed("it is damaged".to_owned())),
    }
}

fn failed(why: String) -> GltfFault {
    GltfFault::Compressed { codec: "meshopt", why }
}
