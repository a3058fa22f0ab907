// The triangles in a cell, by the pattern of its signs. Whoever includes this binds `cases`, two words a pattern: the triangles'
// corners as edges of the cell, four bits each from the lowest on, and in the highest four bits how many triangles there are.

/// How many triangles there are in the given cells of a row.
fn count_triangles(cells: u32, row: u32) -> u32 {
    var count = 0u;
    for (var rest = cells; rest != 0u; rest &= rest - 1u) {
        count += cases[cell_pattern(firstTrailingBit(rest), row)].y >> 28u;
    }
    return count;
}
