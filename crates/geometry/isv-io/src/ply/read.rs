//! The mesh or points in a PLY file: the `vertex`, `face` and `tristrips` elements; all others are skipped.

use super::colours::{Colours, FaceColours, find_colours, find_coordinates};
use super::header::{Element, Encoding, Header, Kind, Scalar};
use super::values::{Ascii, Binary, Fault, Values};
use crate::error::{Flaw, Malformation};
use crate::geometry::Geometry;
use crate::linked::Linked;
use crate::polygon::{Polygons, strip};
use crate::raw_colours::RawColours;
use crate::text;
use glam::DVec3;
use isv_volume::{PointCloud, TriangleMesh};
use std::sync::Arc;

/// Parses a PLY file in memory: points if it has no faces or strips, else a mesh. Bytes after the last element are ignored, as
/// other readers do. Colours are read if linked files are given.
pub(crate) fn parse(bytes: &[u8], linked: Option<&mut Linked>) -> Result<Geometry, Flaw> {
    let bytes = &text::decode(bytes);
    parse_body(bytes, &Header::parse(bytes)?, true, linked).map(|(geometry, _)| geometry)
}

/// The geometry, and how many bytes it takes with its header.
pub(super) fn parse_body(
    bytes: &[u8],
    header: &Header,
    ended: bool,
    linked: Option<&mut Linked>,
) -> Result<(Geometry, usize), Flaw> {
    let binary = |big_endian| Binary::new(bytes, header.body_offset, big_endian);
    match header.encoding {
        Encoding::Ascii => read_body(header, Ascii::new(bytes, header, ended), linked),
        Encoding::BinaryLittleEndian => read_body(header, binary(false), linked),
        Encoding::BinaryBigEndian => read_body(header, binary(true), linked),
    }
    .map(|(geometry, remaining)| (geometry, bytes.len() - remaining))
}

/// What the body holds, and how many bytes follow it.
fn read_body(
    header: &Header,
    mut values: impl Values,
    linked: Option<&mut Linked>,
) -> Result<(Geometry, usize), Flaw> {
    let in_header = |why| Flaw::at_line(header.lines, why);
    let keeps = linked.is_some();
    let mut vertices = Vertices::new(header, keeps).map_err(in_header)?;
    let mut faces = Faces::new(header, "face", keeps).map_err(in_header)?;
    let mut strips = Faces::new(header, "tristrips", false).map_err(in_header)?;
    for element in &header.elements {
        match element {
            _ if element.is("vertex") => {
                vertices.reserve(values.rows_to_reserve(element));
                read_rows(&mut values, element, &mut vertices)?;
            }
            _ if element.is("face") => {
                faces.polygons.reserve(values.rows_to_reserve(element));
                read_rows(&mut values, element, &mut faces)?;
            }
            _ if element.is("tristrips") => read_rows(&mut values, element, &mut Strips(&mut strips))?,
            _ => read_rows(&mut values, element, &mut Skip)?,
        }
    }
    values.finish().map_err(|why| Flaw { at: values.position(), why })?;
    let none_of = |name| header.find(name).is_none_or(|element| element.count == 0);
    if none_of("face") && none_of("tristrips") {
        return Ok((Geometry::Points(vertices.into_points()), values.remaining()));
    }
    let normals = vertices.unit_normals();
    let (mut triangles, corners) = faces.polygons.into_textured(&vertices.positions)?;
    triangles.append(&mut strips.polygons.into_triangles(&vertices.positions)?);
    let appearance = match linked {
        Some(linked) => {
            let colours = Colours {
                textures: &header.textures,
                of_vertices: vertices.colours,
                coordinates: vertices.coordinates,
                of_faces: faces.colours.unwrap_or_default(),
            };
            colours.finish(&triangles, &corners, linked)?.map(Arc::new)
        }
        None => None,
    };
    let mesh = TriangleMesh { vertices: vertices.positions, normals, triangles, appearance };
    Ok((Geometry::Mesh(mesh), values.remaining()))
}

/// Takes the values of rows as they come.
trait Sink {
    /// Whether the values of a property are looked at. What the others hold stops no file.
    fn wants(&self, property: usize) -> bool;
    /// A scalar, or one item of a list, of the row's property at an index.
    fn value(&mut self, property: usize, value: f64) -> Result<(), Malformation>;
    fn end_row(&mut self);
}

fn read_rows(values: &mut impl Values, element: &Element, sink: &mut impl Sink) -> Result<(), Flaw> {
    // Rows of nothing take no bytes, so that the file's length would not bound how many of them a header can claim.
    if element.properties.is_empty() {
        return Ok(());
    }
    for row in 0..element.count {
        read_row(values, element, sink).map_err(|fault| {
            let why = match fault {
                Fault::Malformed(why) => why,
                Fault::End => {
                    Malformation::Truncated { rows: element.rows(), promised: element.count, found: row }
                }
            };
            Flaw { at: values.position(), why }
        })?;
    }
    Ok(())
}

fn read_row(values: &mut impl Values, element: &Element, sink: &mut impl Sink) -> Result<(), Fault> {
    values.begin_row()?;
    for (index, property) in element.properties.iter().enumerate() {
        let (count, scalar) = match property.kind {
            Kind::Scalar(scalar) => (1, scalar),
            Kind::List { length, item } => (values.list_length(length)?, item),
        };
        for _ in 0..count {
            if sink.wants(index) {
                sink.value(index, values.value(scalar)?)?;
            } else {
                values.skip(scalar)?;
            }
        }
    }
    values.end_row()?;
    sink.end_row();
    Ok(())
}

/// Sink for elements that no mesh needs.
struct Skip;

impl Sink for Skip {
    fn wants(&self, _: usize) -> bool {
        false
    }

    fn value(&mut self, _: usize, _: f64) -> Result<(), Malformation> {
        Ok(())
    }

    fn end_row(&mut self) {}
}

/// Values of a vertex that are read: x, y, z, nx, ny, nz, red, green, blue, u, v.
const SLOTS: usize = 11;

/// Sink for the `vertex` element.
struct Vertices {
    /// For each property, its place in `row`.
    slots: Vec<Option<usize>>,
    /// Values of the current row.
    row: [f64; SLOTS],
    has_normals: bool,
    positions: Vec<DVec3>,
    /// Normals as in the file, of any length; empty without nx, ny and nz.
    normals: Vec<DVec3>,
    /// Colours, if they are there and asked for.
    colours: Option<RawColours>,
    /// Texture coordinates, if they are there and asked for.
    coordinates: Option<Vec<[f32; 2]>>,
}

impl Vertices {
    fn new(header: &Header, keeps_colours: bool) -> Result<Self, Malformation> {
        let element = header.find("vertex").ok_or(Malformation::Missing { what: "vertex element" })?;
        let scalar =
            |name| element.find(name).filter(|i| matches!(element.properties[*i].kind, Kind::Scalar(_)));
        let columns = ["x", "y", "z", "nx", "ny", "nz"].map(scalar);
        if columns[..3].contains(&None) && element.count > 0 {
            return Err(Malformation::Missing { what: "vertex properties x, y and z" });
        }
        let mut slots = vec![None; element.properties.len()];
        for (slot, column) in columns.iter().enumerate() {
            if let Some(column) = *column {
                slots[column] = Some(slot);
            }
        }
        let colours = find_colours(element).filter(|_| keeps_colours);
        let coordinates = find_coordinates(element).filter(|_| keeps_colours);
        let looks = colours.map(|(columns, _)| columns).into_iter().flatten().zip(6..);
        for (column, slot) in looks.chain(coordinates.into_iter().flatten().zip(9..)) {
            slots[column] = Some(slot);
        }
        Ok(Self {
            slots,
            row: [0.0; SLOTS],
            has_normals: !columns[3..].contains(&None),
            positions: Vec::new(),
            normals: Vec::new(),
            colours: colours.map(|(_, scale)| RawColours::new(scale, 0)),
            coordinates: coordinates.map(|_| Vec::new()),
        })
    }

    fn reserve(&mut self, rows: usize) {
        self.positions.reserve(rows);
        if self.has_normals {
            self.normals.reserve(rows);
        }
    }

    /// The normals at length 1; none at all if one of them has no direction, since a mesh has all or none.
    fn unit_normals(&self) -> Vec<DVec3> {
        self.normals.iter().map(|n| n.try_normalize()).collect::<Option<_>>().unwrap_or_default()
    }

    fn into_points(self) -> PointCloud {
        PointCloud {
            positions: self.positions,
            normals: self.normals.iter().map(|n| n.normalize_or_zero()).collect(),
            colours: self.colours.map(RawColours::finish).unwrap_or_default(),
            ..PointCloud::default()
        }
    }
}

impl Sink for Vertices {
    fn wants(&self, property: usize) -> bool {
        self.slots[property].is_some()
    }

    fn value(&mut self, property: usize, value: f64) -> Result<(), Malformation> {
        if let Some(slot) = self.slots[property] {
            self.row[slot] = value;
        }
        Ok(())
    }

    fn end_row(&mut self) {
        let [x, y, z, nx, ny, nz, red, green, blue, u, v] = self.row;
        self.positions.push(DVec3::new(x, y, z));
        if self.has_normals {
            self.normals.push(DVec3::new(nx, ny, nz));
        }
        if let Some(colours) = &mut self.colours {
            colours.push([red, green, blue]);
        }
        if let Some(coordinates) = &mut self.coordinates {
            coordinates.push([u, v].map(|value| value as f32));
        }
    }
}

/// Sink for the `face` element.
struct Faces {
    /// The property that lists a row's vertices; `None` without rows, as in a point cloud.
    indices: Option<usize>,
    polygon: Vec<u32>,
    polygons: Polygons,
    /// Colours, if they are asked for.
    colours: Option<FaceColours>,
    /// Numbers of the texture coordinates of the current row's corners; scratch space.
    numbers: Vec<u32>,
}

impl Faces {
    fn new(header: &Header, element: &str, keeps_colours: bool) -> Result<Self, Malformation> {
        let rows = header.find(element).filter(|element| element.count > 0);
        let indices = rows.map(Self::find_indices).transpose()?;
        let colours = rows.filter(|_| keeps_colours).map(FaceColours::new);
        let (polygon, polygons, numbers) = (Vec::new(), Polygons::default(), Vec::new());
        Ok(Self { indices, polygon, polygons, colours, numbers })
    }

    fn find_indices(element: &Element) -> Result<usize, Malformation> {
        let index = element
            .find("vertex_indices")
            .or_else(|| element.find("vertex_index"))
            .ok_or(Malformation::Missing { what: "face property vertex_indices" })?;
        match element.properties[index].kind {
            Kind::List { item, .. } if item.is_integer() => Ok(index),
            Kind::List { item: Scalar::F32, .. } => Err(Malformation::PropertyType { text: "float".into() }),
            Kind::List { .. } => Err(Malformation::PropertyType { text: "double".into() }),
            Kind::Scalar(_) => Err(Malformation::Missing { what: "list of vertices in its face element" }),
        }
    }
}

impl Sink for Faces {
    fn wants(&self, property: usize) -> bool {
        self.indices == Some(property) || self.colours.as_ref().is_some_and(|colours| colours.wants(property))
    }

    fn value(&mut self, property: usize, value: f64) -> Result<(), Malformation> {
        if self.indices == Some(property) {
            if value < 0.0 {
                return Err(Malformation::Index { text: value.to_string() });
            }
            self.polygon.push(value as u32);
        } else if let Some(colours) = &mut self.colours {
            colours.value(property, value);
        }
        Ok(())
    }

    fn end_row(&mut self) {
        match &mut self.colours {
            Some(colours) if colours.has_coordinates() => {
                colours.numbers(self.polygon.len(), &mut self.numbers);
                self.polygons.push_textured(&self.polygon, &self.numbers);
            }
            _ => self.polygons.push(&self.polygon),
        }
        if let Some(colours) = &mut self.colours {
            colours.end_row(self.polygons.triangle_count());
        }
        self.polygon.clear();
    }
}

/// Sink for the `tristrips` element of the Stanford scans: lists of strips, each ended by -1. `polygon` holds the strip so far.
struct Strips<'a>(&'a mut Faces);

impl Sink for Strips<'_> {
    fn wants(&self, property: usize) -> bool {
        self.0.wants(property)
    }

    fn value(&mut self, property: usize, value: f64) -> Result<(), Malformation> {
        if self.0.indices == Some(property) && value == -1.0 {
            self.end_row();
            return Ok(());
        }
        self.0.value(property, value)
    }

    fn end_row(&mut self) {
        strip(&self.0.polygon).for_each(|triangle| self.0.polygons.push(&triangle));
        self.0.polygon.clear();
    }
}
