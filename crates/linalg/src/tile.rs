//! Tile: the product of a strip of rows and a few columns, summed in registers. All dense kernels are built on tiles.
#![allow(unsafe_code)]

use crate::registers::Vector;

/// Maximum number of rows by which a strip may extend beyond the last row. Also the maximum number of columns by which
/// a tile may extend beyond the last column.
pub const SLACK: usize = 8;

/// Column-major matrix, or the part of a matrix that starts at one of its entries.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// Numbers of the matrix, starting with the first entry of the view.
    pub data: &'a [f64],
    /// Distance from one column to the next.
    pub stride: usize,
}

impl<'a> View<'a> {
    /// Creates a view of the matrix in `data` whose columns are `stride` apart.
    #[inline]
    pub fn new(data: &'a [f64], stride: usize) -> Self {
        Self { data, stride }
    }

    /// Returns the view that starts at entry (i, j). The view is empty if this entry does not exist.
    #[inline]
    pub fn at(self, i: usize, j: usize) -> Self {
        Self { data: self.data.get(j * self.stride + i..).unwrap_or_default(), ..self }
    }
}

/// Returns whether `data` contains a matrix with the given numbers of rows and columns, with at least one column.
#[inline(always)]
pub(crate) fn holds(data: &[f64], stride: usize, [rows, columns]: [usize; 2]) -> bool {
    match (columns - 1).checked_mul(stride) {
        Some(last) if last <= data.len() => rows <= data.len() - last,
        _ => false,
    }
}

/// Iterator over the columns of a block of rows. Bounds are checked once, in `new`.
#[derive(Clone, Copy)]
struct Walk<'a> {
    data: &'a [f64],
    at: usize,
    stride: usize,
}

impl<'a> Walk<'a> {
    /// Creates the iterator over `length` > 0 columns, with `count` rows from row `first` on.
    #[inline(always)]
    fn new(of: View<'a>, first: usize, count: usize, length: usize) -> Self {
        let View { data, stride } = of;
        assert!(first <= data.len() && holds(data, stride, [first + count, length]), "a matrix ends before its tile");
        Self { data, at: first, stride }
    }

    /// Returns the rows of the current column, and advances to the next column.
    ///
    /// # Safety
    /// The function is called at most `length` times, with the `count` that was passed to [`new`](Self::new).
    #[inline(always)]
    unsafe fn next(&mut self, count: usize) -> &'a [f64] {
        debug_assert!(self.at + count <= self.data.len());
        // SAFETY: guaranteed by the caller and by the check in `new`.
        let rows = unsafe { core::slice::from_raw_parts(self.data.as_ptr().add(self.at), count) };
        self.at += self.stride;
        rows
    }
}

/// Computes tile = a[i.., ..length] · b[j.., ..length]ᵀ, where the tile has S registers of rows.
#[inline(always)]
pub(crate) fn tile_rows<V: Vector, const S: usize, const COLUMNS: usize>(
    a: View<'_>,
    i: usize,
    b: View<'_>,
    j: usize,
    length: usize,
) -> [[V; S]; COLUMNS] {
    let mut tile = [[V::splat(0.0); S]; COLUMNS];
    if length == 0 {
        return tile;
    }
    let (mut a, mut b) = (Walk::new(a, i, S * V::N, length), Walk::new(b, j, COLUMNS, length));
    for _ in 0..length {
        // SAFETY: `next` is called `length` times, with the row counts given to `new`.
        let (strip, row) = unsafe { (a.next(S * V::N), b.next(COLUMNS)) };
        add_outer(&mut tile, strip, row);
    }
    tile
}

/// Computes tile += strip · rowᵀ, where the strip has S registers of rows.
#[inline(always)]
pub(crate) fn add_outer<V: Vector, const S: usize, const COLUMNS: usize>(
    tile: &mut [[V; S]; COLUMNS],
    strip: &[f64],
    row: &[f64],
) {
    let mut registers = [V::splat(0.0); S];
    for s in 0..S {
        registers[s] = V::load(&strip[s * V::N..]);
    }
    for jj in 0..COLUMNS {
        let x = V::splat(row[jj]);
        for s in 0..S {
            tile[jj][s] = registers[s].mul_add(x, tile[jj][s]);
        }
    }
}

/// Returns the number of registers in the next strip, given the number of `rows` that are left. On processors with 32
/// vector registers, the result is three, or two if the strip after it would have only one register. On other
/// processors, the result is two, because strips of three registers spilled in measurements.
#[inline(always)]
pub(crate) fn next_strip<V: Vector>(rows: usize) -> usize {
    match rows.div_ceil(V::N) {
        1 => 1,
        2 | 4 => 2,
        _ if V::N < 8 => 2,
        _ => 3,
    }
}

/// Operation that stores a product in an entry of C.
#[derive(Clone, Copy)]
pub(crate) enum Store {
    /// Stores the product: C = product.
    Set,
    /// Adds the product: C = C + product.
    Add,
    /// Subtracts the product: C = C − product.
    Subtract,
}

/// Returns whether each of `columns` columns (at least one) has S registers of rows from offset `at` on.
#[inline(always)]
pub(crate) fn has_strip<V: Vector, const S: usize>(data: &[f64], stride: usize, at: usize, columns: usize) -> bool {
    at <= data.len() && holds(&data[at..], stride, [S * V::N, columns])
}

/// Stores the first `columns` columns of a tile in C, with the tile's first entry at (i, j).
#[inline(always)]
pub(crate) fn store_tile<V: Vector, const S: usize, const COLUMNS: usize>(
    c: &mut [f64],
    ldc: usize,
    [i, j]: [usize; 2],
    columns: usize,
    tile: &[[V; S]; COLUMNS],
    how: Store,
) {
    let at = j * ldc + i;
    assert!(has_strip::<V, S>(c, ldc, at, columns), "a matrix ends before its tile");
    for jj in 0..COLUMNS {
        if jj < columns {
            let at = at + jj * ldc;
            // SAFETY: the slice is column jj of the strip, which the assertion found to be in bounds.
            let column = unsafe { c.get_unchecked_mut(at..at + S * V::N) };
            for s in 0..S {
                let place = &mut column[s * V::N..];
                let product = tile[jj][s];
                match how {
                    Store::Set => product.store(place),
                    Store::Add => V::load(place).add(product).store(place),
                    Store::Subtract => V::load(place).sub(product).store(place),
                }
            }
        }
    }
}

/// Computes C[i, j] ← A[i, ..length] · B[j, ..length]ᵀ for the given rows i and for `columns` columns from column j on.
/// Strips have up to three registers. `how` selects whether the product is set, added or subtracted.
#[inline(always)]
pub(crate) fn column_block<V: Vector, const COLUMNS: usize>(
    c: &mut [f64],
    ldc: usize,
    rows: core::ops::Range<usize>,
    j: usize,
    columns: usize,
    a: View<'_>,
    b: View<'_>,
    length: usize,
    how: Store,
) {
    let mut i = rows.start;
    while i < rows.end {
        let strip = next_strip::<V>(rows.end - i);
        match strip {
            1 => {
                let tile = tile_rows::<V, 1, COLUMNS>(a, i, b, j, length);
                store_tile(c, ldc, [i, j], columns, &tile, how);
            }
            2 => {
                let tile = tile_rows::<V, 2, COLUMNS>(a, i, b, j, length);
                store_tile(c, ldc, [i, j], columns, &tile, how);
            }
            _ => {
                let tile = tile_rows::<V, 3, COLUMNS>(a, i, b, j, length);
                store_tile(c, ldc, [i, j], columns, &tile, how);
            }
        }
        i += strip * V::N;
    }
}
