//! Typed reading of accessors: strided, normalised, sparse.

use super::buffers::Buffers;
use super::fault::GltfFault;
use super::limit::Limit;
use super::meshopt;
use super::schema::{Accessor, Document, ObjectName, Sparse, object};
use crate::error::{Flaw, quote};
use std::cell::OnceCell;

/// The type of one component of an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn of_code(code: u32) -> Option<Self> {
        Some(match code {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => return None,
        })
    }

    fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// What normalised integers are divided by; 1 for floats, which are not divided.
    fn largest(self) -> f32 {
        match self {
            Self::I8 => 127.0,
            Self::U8 => 255.0,
            Self::I16 => 32767.0,
            Self::U16 => 65535.0,
            Self::U32 => u32::MAX as f32,
            Self::F32 => 1.0,
        }
    }

    fn is_unsigned(self) -> bool {
        matches!(self, Self::U8 | Self::U16 | Self::U32)
    }
}

/// A number of an accessor.
trait Number: Copy + Default {
    /// Whether components of a type can become this.
    fn takes(component: Component) -> bool;
    /// From the bytes at the start of `bytes`.
    fn read(component: Component, normalized: bool, bytes: &[u8]) -> Self;
}

impl Number for f32 {
    fn takes(_: Component) -> bool {
        true
    }

    /// Normalised integers as section 3.11 of the specification has them.
    fn read(component: Component, normalized: bool, bytes: &[u8]) -> Self {
        let value = match component {
            Component::I8 => f32::from(bytes[0] as i8),
            Component::U8 => f32::from(bytes[0]),
            Component::I16 => f32::from(i16::from_le_bytes([bytes[0], bytes[1]])),
            Component::U16 => f32::from(u16::from_le_bytes([bytes[0], bytes[1]])),
            Component::U32 => u32::read(component, false, bytes) as f32,
            Component::F32 => return Self::from_bits(u32::read(component, false, bytes)),
        };
        if normalized { (value / component.largest()).max(-1.0) } else { value }
    }
}

impl Number for u32 {
    fn takes(component: Component) -> bool {
        component.is_unsigned()
    }

    fn read(component: Component, _: bool, bytes: &[u8]) -> Self {
        match component.bytes() {
            1 => bytes[0].into(),
            2 => u16::from_le_bytes([bytes[0], bytes[1]]).into(),
            _ => Self::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
        }
    }
}

/// Reads accessors, within a limit of memory.
pub(super) struct Accessors<'a> {
    document: &'a Document,
    buffers: Buffers<'a>,
    pub(super) limit: Limit,
    /// The bytes of views that were decompressed.
    decompressed: Vec<OnceCell<Vec<u8>>>,
}

impl<'a> Accessors<'a> {
    pub(super) fn new(document: &'a Document, buffers: Buffers<'a>, limit: Limit) -> Self {
        let decompressed = document.buffer_views.iter().map(|_| OnceCell::new()).collect();
        Self { document, buffers, limit, decompressed }
    }

    /// The elements of accessor `index`, named by an object, as `f32`; `wanted` is their type in the specification's words.
    pub(super) fn floats<const N: usize>(
        &self,
        index: usize,
        wanted: &'static str,
        named_by: ObjectName,
    ) -> Result<Vec<[f32; N]>, Flaw> {
        self.read(index, wanted, named_by)
    }

    /// Elements of an accessor of unsigned integers.
    pub(super) fn integers<const N: usize>(
        &self,
        index: usize,
        wanted: &'static str,
        named_by: ObjectName,
    ) -> Result<Vec<[u32; N]>, Flaw> {
        self.read(index, wanted, named_by)
    }

    fn read<T: Number, const N: usize>(
        &self,
        index: usize,
        wanted: &'static str,
        named_by: ObjectName,
    ) -> Result<Vec<[T; N]>, Flaw> {
        let accessor = object(&self.document.accessors, "accessor", index, named_by)?;
        let flaw = |fault: GltfFault| Flaw::in_object("accessor", index, fault);
        let component = Component::of_code(accessor.component_type).filter(|c| T::takes(*c));
        let (true, Some(component)) = (accessor.shape == wanted, component) else {
            let found = format!("{} of type {}", quote(accessor.shape.as_bytes()), accessor.component_type);
            return Err(flaw(GltfFault::AccessorType { wanted, found }));
        };
        let layout = Layout { component, normalized: accessor.normalized };
        let base = accessor.buffer_view.map(|view| self.view(view, ("accessor", index))).transpose()?;
        let rows = match &base {
            Some(view) => {
                Some(view.rows(accessor.byte_offset, accessor.count, N * component.bytes()).map_err(flaw)?)
            }
            None => None,
        };
        // Bytes for every element are there by now, or the limit holds.
        self.limit.take(accessor.count, N).map_err(flaw)?;
        let mut elements: Vec<[T; N]> = match rows {
            Some(rows) => rows.map(|row| layout.element(row)).collect(),
            None => vec![[T::default(); N]; accessor.count],
        };
        if let Some(sparse) = &accessor.sparse {
            self.substitute(&mut elements, sparse, layout, index)?;
        }
        Ok(elements)
    }

    /// Puts the elements of a sparse accessor in their places.
    fn substitute<T: Number, const N: usize>(
        &self,
        elements: &mut [[T; N]],
        sparse: &Sparse,
        layout: Layout,
        index: usize,
    ) -> Result<(), Flaw> {
        let flaw = |fault: GltfFault| Flaw::in_object("accessor", index, fault);
        let code = sparse.indices.component_type;
        let component = Component::of_code(code).filter(|c| c.is_unsigned()).ok_or_else(|| {
            flaw(GltfFault::AccessorType { wanted: "an unsigned index", found: format!("type {code}") })
        })?;
        let places = self.view(sparse.indices.buffer_view, ("accessor", index))?;
        let places =
            places.rows(sparse.indices.byte_offset, sparse.count, component.bytes()).map_err(flaw)?;
        let values = self.view(sparse.values.buffer_view, ("accessor", index))?;
        let row_bytes = N * layout.component.bytes();
        let values = values.rows(sparse.values.byte_offset, sparse.count, row_bytes).map_err(flaw)?;
        for (place, value) in places.zip(values) {
            let place = u32::read(component, false, place) as usize;
            let count = elements.len();
            let element = elements
                .get_mut(place)
                .ok_or_else(|| flaw(GltfFault::NoSuch { kind: "element", index: place, count }))?;
            *element = layout.element(value);
        }
        Ok(())
    }

    /// The number of elements that an accessor says it has.
    pub(super) fn count(&self, index: usize, named_by: ObjectName) -> Result<usize, Flaw> {
        object(&self.document.accessors, "accessor", index, named_by)
            .map(|accessor: &Accessor| accessor.count)
    }

    /// What the integers of an accessor are divided by to become its numbers, as it says; 1 if they are the numbers.
    pub(super) fn divisor(&self, index: usize, named_by: ObjectName) -> Result<f32, Flaw> {
        let accessor = object(&self.document.accessors, "accessor", index, named_by)?;
        let component = Component::of_code(accessor.component_type).filter(|_| accessor.normalized);
        Ok(component.map_or(1.0, Component::largest))
    }

    /// Type of an accessor's elements, in the specification's words. The second value makes its numbers 0 to
    /// 1, should they be integers that are not normalised.
    pub(super) fn shape_and_largest(&self, index: usize, named_by: ObjectName) -> Result<(&str, f32), Flaw> {
        let accessor = object(&self.document.accessors, "accessor", index, named_by)?;
        let component = Component::of_code(accessor.component_type).filter(|_| !accessor.normalized);
        Ok((&accessor.shape, component.map_or(1.0, Component::largest)))
    }

    /// The bytes of a view.
    pub(super) fn bytes(&self, view: usize, named_by: ObjectName) -> Result<&[u8], Flaw> {
        Ok(self.view(view, named_by)?.bytes)
    }

    fn view(&self, index: usize, named_by: ObjectName) -> Result<View<'_>, Flaw> {
        let view = object(&self.document.buffer_views, "bufferView", index, named_by)?;
        let flaw = |fault: GltfFault| Flaw::in_object("bufferView", index, fault);
        if let Some(name) = view.extensions.others.keys().find(|name| name.ends_with("_compression")) {
            return Err(flaw(GltfFault::Extension { extension: quote(name.as_bytes()) }));
        }
        let Some(compressed) = view.extensions.meshopt() else {
            let bytes = self.range(view.buffer, view.byte_offset, view.byte_length).map_err(flaw)?;
            return Ok(View { bytes, stride: view.byte_stride });
        };
        let bytes = match self.decompressed[index].get() {
            Some(bytes) => bytes,
            None => {
                let source = self.range(compressed.buffer, compressed.byte_offset, compressed.byte_length);
                let bytes = source.and_then(|source| meshopt::decode(compressed, source, &self.limit));
                let bytes = bytes.map_err(flaw)?;
                self.decompressed[index].get_or_init(|| bytes)
            }
        };
        let of_rows = (compressed.mode == meshopt::ATTRIBUTES).then_some(compressed.byte_stride);
        Ok(View { bytes, stride: view.byte_stride.or(of_rows) })
    }

    /// Bytes of a buffer.
    fn range(&self, buffer: usize, offset: usize, length: usize) -> Result<&[u8], GltfFault> {
        let bytes = self.buffers.get(buffer).ok_or(GltfFault::NoSuch {
            kind: "buffer",
            index: buffer,
            count: self.buffers.len(),
        })?;
        let end = offset.saturating_add(length);
        bytes.get(offset..end).ok_or_else(|| past_end(end, bytes.len()))
    }
}

fn past_end(end: usize, bytes: usize) -> GltfFault {
    GltfFault::PastEnd { end: end as u64, bytes: bytes as u64 }
}

/// How the components of an element are read.
#[derive(Clone, Copy)]
struct Layout {
    component: Component,
    normalized: bool,
}

impl Layout {
    fn element<T: Number, const N: usize>(self, row: &[u8]) -> [T; N] {
        let mut element = [T::default(); N];
        for (component, bytes) in element.iter_mut().zip(row.chunks_exact(self.component.bytes())) {
            *component = T::read(self.component, self.normalized, bytes);
        }
        element
    }
}

/// The bytes of a buffer view.
struct View<'a> {
    bytes: &'a [u8],
    stride: Option<usize>,
}

impl<'a> View<'a> {
    /// `count` rows of `row_bytes`, the first at `offset`; all of them lie in the view, and do not overlap.
    fn rows(
        &self,
        offset: usize,
        count: usize,
        row_bytes: usize,
    ) -> Result<impl Iterator<Item = &'a [u8]> + use<'a>, GltfFault> {
        let stride = self.stride.unwrap_or(row_bytes);
        if stride < row_bytes {
            return Err(GltfFault::Stride { stride: stride as u64, bytes: row_bytes as u64 });
        }
        let length = match count {
            0 => 0,
            _ => (count - 1).saturating_mul(stride).saturating_add(row_bytes),
        };
        let end = offset.saturating_add(length);
        let rows = self.bytes.get(offset..end).ok_or_else(|| past_end(end, self.bytes.len()))?;
        Ok(rows.chunks(stride).map(move |row| &row[..row_bytes]))
    }
}
