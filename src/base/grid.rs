/// A picture's worth of numbers: row-major, row 0 at the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid<T> {
    columns: usize,
    rows: usize,
    data: Vec<T>,
}

impl<T: Clone> Grid<T> {
    /// A grid where every cell holds `value`.
    pub fn filled(columns: usize, rows: usize, value: T) -> Self {
        Self { columns, rows, data: vec![value; columns * rows] }
    }
}

impl Grid<f32> {
    /// The largest value; 0 where none is larger.
    pub fn largest(&self) -> f32 {
        self.data.iter().copied().fold(0.0, f32::max)
    }
}

impl<T> Grid<T> {
    /// Wraps row-major data.
    ///
    /// # Panics
    /// If `data` does not hold exactly `columns * rows` values: that is a mistake of the caller,
    /// never of an input.
    pub fn from_vec(columns: usize, rows: usize, data: Vec<T>) -> Self {
        assert_eq!(data.len(), columns * rows, "grid of {columns} x {rows}");
        Self { columns, rows, data }
    }

    /// Width in pixels.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Height in pixels.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// All values, row-major.
    pub fn data(&self) -> &[T] {
        &self.data
    }

    /// All values, row-major.
    pub fn data_mut(&mut self) -> &mut [T] {
        &mut self.data
    }

    /// The values of one row.
    pub fn row(&self, row: usize) -> &[T] {
        &self.data[row * self.columns..(row + 1) * self.columns]
    }

    /// A grid of the same size with `f` applied to every value.
    pub fn map<U>(&self, f: impl FnMut(&T) -> U) -> Grid<U> {
        Grid { columns: self.columns, rows: self.rows, data: self.data.iter().map(f).collect() }
    }
}

impl<T> std::ops::Index<(usize, usize)> for Grid<T> {
    type Output = T;

    /// The value at `(column, row)`.
    fn index(&self, (column, row): (usize, usize)) -> &T {
        assert!(column < self.columns, "column {column} of {}", self.columns);
        &self.data[row * self.columns + column]
    }
}

impl<T> std::ops::IndexMut<(usize, usize)> for Grid<T> {
    fn index_mut(&mut self, (column, row): (usize, usize)) -> &mut T {
        assert!(column < self.columns, "column {column} of {}", self.columns);
        &mut self.data[row * self.columns + column]
    }
}

/// A rectangle of pixels: the unit in which views are rendered and volumes are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct TileRect {
    /// Left-most column.
    pub column: usize,
    /// Top row.
    pub row: usize,
    /// Width in pixels.
    pub columns: usize,
    /// Height in pixels.
    pub rows: usize,
}

impl TileRect {
    /// Number of pixels in the tile.
    pub fn pixels(&self) -> usize {
        self.columns * self.rows
    }
}

/// A view cut into square tiles, numbered row by row; those at the right and lower border may be
/// smaller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tiles {
    /// Width of the view, pixels.
    pub columns: usize,
    /// Height of the view, pixels.
    pub rows: usize,
    /// Edge of a tile, pixels.
    pub edge: usize,
}

impl Tiles {
    /// Tiles in a row.
    pub fn across(&self) -> usize {
        self.columns.div_ceil(self.edge)
    }

    /// Rows of tiles.
    pub fn down(&self) -> usize {
        self.rows.div_ceil(self.edge)
    }

    /// Number of tiles.
    pub fn count(&self) -> usize {
        self.across() * self.down()
    }

    /// The pixels of tile `number`.
    pub fn rect(&self, number: usize) -> TileRect {
        let (row, column) =
            (number / self.across() * self.edge, number % self.across() * self.edge);
        TileRect {
            column,
            row,
            columns: self.edge.min(self.columns - column),
            rows: self.edge.min(self.rows - row),
        }
    }

    /// The number of a tile; `None` where it isn't one of these.
    pub fn number(&self, tile: TileRect) -> Option<usize> {
        let inside = tile.column < self.columns && tile.row < self.rows;
        let number = tile.row / self.edge * self.across() + tile.column / self.edge;
        (inside && self.rect(number) == tile).then_some(number)
    }
}

/// The tiles of at most `edge` x `edge` pixels that cover a view, row by row.
pub fn tiles(columns: usize, rows: usize, edge: usize) -> Vec<TileRect> {
    let tiles = Tiles { columns, rows, edge };
    (0..tiles.count()).map(|number| tiles.rect(number)).collect()
}
