//! The tile that all dense kernels are built from: a strip of registers of rows by a few columns, accumulated in registers.

use crate::registers::Vector;

/// Rows that a strip may reach past the last row, and columns that a tile may reach past the last column.
pub const SLACK: usize = 8;

/// A matrix in column-major storage, from one of its entries on.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// The numbers, the first one that entry's.
    pub data: &'a [f64],
    /// The distance from one column to the next.
    pub stride: usize,
}

impl<'a> View<'a> {
    /// The matrix in `data` whose columns are `stride` apart.
    #[inline]
    pub fn new(data: &'a [f64], stride: usize) -> Self {
        Self { data, stride }
    }

    /// The matrix from entry (i, j) on; nothing where there is no such entry.
    #[inline]
    pub fn at(self, i: usize, j: usize) -> Self {
        Self { data: self.data.get(j * self.stride + i..).unwrap_or_default(), ..self }
    }
}

/// tile = a[i.., ..length] · b[j.., ..length]ᵀ, with S registers of rows.
#[inline(always)]
pub(crate) fn tile_rows<V: Vector, const S: usize, const COLUMNS: usize>(
    a: View<'_>,
    i: usize,
    b: View<'_>,
    j: usize,
    length: usize,
) -> [[V; S]; COLUMNS] {
    let mut tile = [[V::splat(0.0); S]; COLUMNS];
    for k in 0..length {
        let strip = &a.data[k * a.stride + i..][..S * V::N];
        let row = &b.data[k * b.stride + j..][..COLUMNS];
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
    tile
}

/// The new value of an entry of C.
#[derive(Clone, Copy)]
pub(crate) enum Store {
    /// The product.
    Set,
    /// C plus the product.
    Add,
    /// C minus the product.
    Subtract,
}

/// Stores the first `columns` columns of a tile in C, from entry (i, j) on.
#[inline(always)]
fn store_tile<V: Vector, const S: usize, const COLUMNS: usize>(
    c: &mut [f64],
    ldc: usize,
    [i, j]: [usize; 2],
    columns: usize,
    tile: &[[V; S]; COLUMNS],
    how: Store,
) {
    for jj in 0..COLUMNS {
        if jj < columns {
            let column = &mut c[(j + jj) * ldc + i..][..S * V::N];
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

/// C[i, j] ← A[i, ..length] · B[j, ..length]ᵀ for some rows and for `columns` columns from j on, in strips of two registers;
/// the last strip has one register where that is enough.
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
        if rows.end - i > V::N {
            let tile = tile_rows::<V, 2, COLUMNS>(a, i, b, j, length);
            store_tile(c, ldc, [i, j], columns, &tile, how);
            i += 2 * V::N;
        } else {
            let tile = tile_rows::<V, 1, COLUMNS>(a, i, b, j, length);
            store_tile(c, ldc, [i, j], columns, &tile, how);
            i += V::N;
        }
    }
}
