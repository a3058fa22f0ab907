//! Which side the places are on that no block covers.

/// The side of a child's first and last voxel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Ends {
    pub(super) first_inside: bool,
    pub(super) last_inside: bool,
}

/// Gives each of `side^3` places, z fastest, a side. What is not known is on that of the known place before
/// it along z, else along y, else along x. Else it is on that of the first known place. This is how OpenVDB
/// fills a level set from its narrow band.
pub(super) fn spread_signs(side: usize, known: &[Option<Ends>]) -> Vec<bool> {
    let first = known.iter().flatten().next().is_some_and(|ends| ends.first_inside);
    let after = |place: usize, before: bool| known[place].map_or(before, |ends| ends.last_inside);
    let mut inside = Vec::with_capacity(known.len());
    let mut along_x = first;
    for x in 0..side {
        along_x = after(x * side * side, along_x);
        let mut along_y = along_x;
        for y in 0..side {
            along_y = after((x * side + y) * side, along_y);
            let mut along_z = along_y;
            for z in 0..side {
                along_z = after((x * side + y) * side + z, along_z);
                inside.push(along_z);
            }
        }
    }
    inside
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_are_carried_from_the_last_known_place() {
        let ends = |first_inside, last_inside| Some(Ends { first_inside, last_inside });
        assert_eq!(spread_signs(2, &[None; 8]), [false; 8]);
        let mut known = [None; 8];
        known[3] = ends(true, false);
        assert_eq!(spread_signs(2, &known), [true, true, true, false, true, true, true, true]);
        known[4] = ends(false, true);
        known[6] = ends(true, false);
        assert_eq!(spread_signs(2, &known)[4..], [true, true, false, false]);
    }
}
