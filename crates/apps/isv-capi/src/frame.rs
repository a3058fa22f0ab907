//! Decoded frames.

use crate::call::call_ok;
use crate::handle::{self, Handle};
use crate::memory::write;
use crate::status::isv_status;
use crate::types::{isv_frame_info, isv_mesh, isv_points, isv_volume};
use isv::{Frame, Mesh, Points, VolumeArrays};
use std::collections::{BTreeMap, btree_map::Entry};
use std::ptr::null;
use std::sync::{Mutex, PoisonError};

/// A decoded frame. Its surface, points and field are made when they are first asked for, and live until the frame is freed.
///
/// Several threads may use a frame at once. It stays good when its reader is freed.
pub struct isv_frame;

/// Object behind a handle of a frame. Arrays that were made once stay until the frame is freed: pointers to them are out.
pub(crate) struct State {
    frame: Frame,
    mesh: Mutex<Option<Box<Mesh>>>,
    /// Points, by how many were asked for.
    points: Mutex<BTreeMap<usize, Box<Points>>>,
    volume: Mutex<Option<Box<VolumeArrays>>>,
}

impl Handle for isv_frame {
    type Object = State;
    const NAME: &'static str = "isv_frame";
}

pub(crate) fn add(frame: Frame) -> *mut isv_frame {
    handle::add(State { frame, mesh: Mutex::default(), points: Mutex::default(), volume: Mutex::default() })
}

/// Frees a frame, with all arrays that it gave. Null is no error.
#[unsafe(no_mangle)]
pub extern "C" fn isv_frame_free(frame: *mut isv_frame) -> isv_status {
    call_ok(|| handle::free(frame))
}

/// Tells facts of a frame. `info` is the caller's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_frame_get_info(
    frame: *const isv_frame,
    info: *mut isv_frame_info,
) -> isv_status {
    call_ok(|| {
        let state = handle::get(frame)?;
        let value = isv_frame_info {
            struct_size: 0,
            number: state.frame.number() as u64,
            timestamp_ns: u64::try_from(state.frame.timestamp().as_nanos()).unwrap_or(u64::MAX),
        };
        // SAFETY: isv.h asks for a struct.
        unsafe { write(info, &value) }
    })
}

/// A pointer to the first number of an array; null for an empty one.
fn first<T, U>(array: &[T]) -> *const U {
    if array.is_empty() { null() } else { array.as_ptr().cast() }
}

/// Gives the surface as a mesh, with normals, and with colours if the stream has any. `mesh` is the caller's, its arrays are the
/// frame's. A frame without a surface has no vertices, and null pointers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_frame_get_mesh(frame: *const isv_frame, mesh: *mut isv_mesh) -> isv_status {
    call_ok(|| {
        let state = handle::get(frame)?;
        // A panic while the mesh was made has left none behind.
        let mut made = state.mesh.lock().unwrap_or_else(PoisonError::into_inner);
        if made.is_none() {
            *made = Some(Box::new(state.frame.mesh()?));
        }
        let Some(surface) = made.as_deref() else { return Ok(()) };
        let value = isv_mesh {
            struct_size: 0,
            vertex_count: surface.positions.len(),
            triangle_count: surface.triangles.len(),
            positions: first(&surface.positions),
            normals: first(&surface.normals),
            colours: first(&surface.colours),
            indices: first(&surface.triangles),
        };
        // SAFETY: isv.h asks for a struct.
        unsafe { write(mesh, &value) }
    })
}

/// Spreads points evenly over the surface, with normals, and with colours if the stream has any. `points` is the caller's, its arrays
/// are the frame's.
///
/// `count` is their number; 0 for one a square of the surface with an edge of a voxel. At most 100 million.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_frame_get_points(
    frame: *const isv_frame,
    count: usize,
    points: *mut isv_points,
) -> isv_status {
    call_ok(|| {
        let state = handle::get(frame)?;
        // A panic while points were made has left none behind.
        let mut made = state.points.lock().unwrap_or_else(PoisonError::into_inner);
        let kept = match made.entry(count) {
            Entry::Occupied(kept) => kept.into_mut(),
            Entry::Vacant(place) => place.insert(Box::new(match count {
                0 => state.frame.points_by_voxel()?,
                count => state.frame.points(count)?,
            })),
        };
        let value = isv_points {
            struct_size: 0,
            count: kept.positions.len(),
            positions: first(&kept.positions),
            normals: first(&kept.normals),
            colours: first(&kept.colours),
            viewpoint: null(),
        };
        // SAFETY: isv.h asks for a struct.
        unsafe { write(points, &value) }
    })
}

/// Gives the field of signed distances. `volume` is the caller's, its arrays are the frame's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn isv_frame_get_volume(
    frame: *const isv_frame,
    volume: *mut isv_volume,
) -> isv_status {
    call_ok(|| {
        let state = handle::get(frame)?;
        // A panic while the field was made has left none behind.
        let mut made = state.volume.lock().unwrap_or_else(PoisonError::into_inner);
        if made.is_none() {
            *made = Some(Box::new(state.frame.volume_arrays()?));
        }
        let Some(field) = made.as_deref() else { return Ok(()) };
        let value = isv_volume {
            struct_size: 0,
            voxel_m: field.voxel_m,
            block_edge: field.edge,
            truncation_voxels: field.truncation_voxels,
            block_count: field.coords.len(),
            coords: first(&field.coords),
            distances: first(&field.distances_m),
        };
        // SAFETY: isv.h asks for a struct.
        unsafe { write(volume, &value) }
    })
}
