//! Tests of memory in which columns begin at cache lines.

use condyle_linalg::{Aligned, SLACK, padded};

/// Number of bytes of a cache line.
const LINE: usize = 64;

#[test]
fn columns_begin_at_cache_lines_with_padding_after_them() {
    for rows in 0..300 {
        let stride = padded(rows);
        assert!((rows + SLACK..rows + SLACK + 16).contains(&stride), "{rows} rows have the stride {stride}");
        assert_ne!(stride % 64, 0, "{rows} rows have the stride {stride}, a multiple of eight lines");
        let matrix = Aligned::zeros(3 * stride);
        assert_eq!(matrix.len(), 3 * stride);
        for column in matrix.chunks_exact(stride) {
            assert_eq!(column.as_ptr() as usize % LINE, 0, "{rows} rows");
        }
    }
}

#[test]
fn lengths_are_rounded_up_and_numbers_are_kept() {
    let mut numbers = Aligned::zeros(5);
    assert_eq!(&numbers[..], [0.0; 8]);
    numbers[7] = 3.0;
    numbers.resize(17);
    assert_eq!(numbers.len(), 24);
    assert_eq!((numbers[7], numbers[8..].iter().sum::<f64>()), (3.0, 0.0));
    let copy = numbers.clone();
    assert_eq!(copy, numbers);
    numbers.resize(8);
    assert_eq!(&numbers[..], &copy[..8]);
}
