//! Tables of numbers.

use comfy_table::{CellAlignment, LineStyle, Table, TableStyle};

/// An empty table with a header: names to the left, numbers to the right.
pub(crate) fn table_of<const COLUMNS: usize>(header: [&str; COLUMNS]) -> Table {
    let mut table = Table::new();
    table.load_style(TableStyle::new().header_separator(LineStyle::none().fill('─').junction('─')));
    table.set_header(header);
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}
