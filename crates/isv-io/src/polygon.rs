//! Polygons to triangles.

/// Appends the triangles of a polygon as a fan around its first corner; nothing for fewer than three corners.
///
/// Right for convex polygons, which is what both file formats ask for.
pub(crate) fn push_fan(corners: &[u32], triangles: &mut Vec<[u32; 3]>) {
    if let [apex, rim @ ..] = corners {
        triangles.extend(rim.windows(2).map(|edge| [*apex, edge[0], edge[1]]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fan_keeps_orientation_and_skips_degenerate_polygons() {
        let mut triangles = Vec::new();
        for short in [&[][..], &[7], &[7, 8]] {
            push_fan(short, &mut triangles);
        }
        assert!(triangles.is_empty());
        push_fan(&[4, 5, 6, 7], &mut triangles);
        assert_eq!(triangles, [[4, 5, 6], [4, 6, 7]]);
    }
}
