//! Tests of arrays and matrices in workspaces, and of types with the same memory layout.
#![allow(non_snake_case, unsafe_code)] // M

use condyle_spatial::gate::{self, FusedF64, Rename, SimdToken};
use condyle_spatial::level::Level;
use condyle_spatial::{Array, Matrix, Motion, matrix};
use nalgebra::{DMatrix, RawStorage, Storage, dmatrix};
use std::rc::Rc;

/// Checks that arrays drop and clone each entry once. Each entry is a reference-counted pointer, and its count shows
/// whether the entry was dropped.
#[test]
fn arrays_drop_and_clone_each_entry_once() {
    let owners: Vec<Rc<usize>> = (0..5).map(Rc::new).collect();
    let array: Array<_> = owners.iter().cloned().collect();
    let copy = array.clone();
    assert_eq!(array, copy);
    assert!(owners.iter().all(|owner| Rc::strong_count(owner) == 3));
    drop(array);
    assert!(owners.iter().all(|owner| Rc::strong_count(owner) == 2));
    let back = Vec::from(copy);
    assert!(owners.iter().all(|owner| Rc::strong_count(owner) == 2));
    assert_eq!(back, owners);
    drop(back);
    assert!(owners.iter().all(|owner| Rc::strong_count(owner) == 1));
}

/// Checks that the unused capacity of a `Vec` is freed when the `Vec` becomes an array.
#[test]
fn arrays_take_vectors_with_room() {
    let mut entries = Vec::with_capacity(10);
    entries.extend([1.0, 2.0, 3.0]);
    let mut array = Array::from(entries);
    array[1] = 5.0;
    for x in &mut array {
        *x += 1.0;
    }
    assert_eq!(array[..], [2.0, 6.0, 4.0]);
    assert_eq!((&array).into_iter().sum::<f64>(), 12.0);
    assert_eq!(format!("{array:?}"), "[2.0, 6.0, 4.0]");
}

#[test]
fn arrays_may_be_empty() {
    let empty = Array::<f64>::default();
    assert!(empty.is_empty() && empty.clone().is_empty() && Vec::from(empty).is_empty());
    let none: Array<Rc<usize>> = Vec::with_capacity(3).into();
    assert_eq!(none.len(), 0);
}

#[test]
fn arrays_hold_entries_without_size() {
    let units: Array<()> = vec![(); 7].into();
    assert_eq!((units.len(), units.clone().len(), Vec::from(units).len()), (7, 7, 7));
}

/// Checks the alignment of arrays whose entries are vectors of eight numbers: 64 bytes.
#[test]
fn arrays_align_their_entries() {
    #[derive(Clone, Debug, PartialEq)]
    #[repr(align(64))]
    struct CacheLine([f64; 8]);
    let array: Array<CacheLine> = (0..3).map(|k| CacheLine([f64::from(k); 8])).collect();
    let copy = array.clone();
    assert!(array.as_ptr().addr().is_multiple_of(64) && copy.as_ptr().addr().is_multiple_of(64));
    assert_eq!((array[2].0[7], copy), (2.0, array.clone()));

    struct Gate;
    // SAFETY: vectors are created only where the processor supports them.
    unsafe impl SimdToken for Gate {}
    type Wide = gate::Wide<Gate>;
    if !cfg!(target_arch = "x86_64") || Level::Avx512.is_supported() {
        let lanes: Array<Wide> = vec![condyle_spatial::Scalar::splat(1.5); 3].into();
        assert!(lanes.as_ptr().addr().is_multiple_of(align_of::<Wide>()));
    }
}

#[test]
fn arrays_cross_threads() {
    fn crosses<T: Send + Sync>() {}
    crosses::<Array<f64>>();
    crosses::<Matrix<f64>>();
}

#[test]
fn alike_types_are_reinterpreted() {
    let mut M: Matrix<f64> = matrix(2, 2, 3.0);
    let same: &mut Matrix<FusedF64> = Rename::renamed(&mut M);
    same[(1, 0)] = FusedF64(5.0);
    assert_eq!(M, dmatrix![3.0, 3.0; 5.0, 3.0]);
    let same: Matrix<FusedF64> = M.renamed();
    assert_eq!((same.shape(), same[1]), ((2, 2), FusedF64(5.0)));

    let mut array: Array<Motion<f64>> = vec![Motion::zero(); 3].into();
    let same: &mut Array<Motion<FusedF64>> = Rename::renamed(&mut array);
    same[2].angular.y = FusedF64(7.0);
    let same: &[Motion<FusedF64>] = Rename::renamed(&array[1..]);
    assert_eq!((same.len(), same[1].angular.y), (2, FusedF64(7.0)));
    let [same, none]: [Option<&[FusedF64]>; 2] = Rename::renamed([Some(&[1.0, 2.0][..]), None]);
    assert_eq!((same, none), (Some(&[FusedF64(1.0), FusedF64(2.0)][..]), None));
    let array: Array<Motion<FusedF64>> = array.renamed();
    assert_eq!(array[2].angular.y, FusedF64(7.0));
}

#[test]
fn matrices_are_matrices_of_nalgebra() {
    let mut M: Matrix<f64> = matrix(2, 3, 0.0);
    let numbers = dmatrix![1.0, 2.0, 3.0; 4.0, 5.0, 6.0];
    M.copy_from(&numbers);
    assert_eq!(M, numbers);
    assert_eq!(M.as_slice(), [1.0, 4.0, 2.0, 5.0, 3.0, 6.0]);
    assert_eq!((M[(1, 2)], M[3], M.shape()), (6.0, 5.0, (2, 3)));
    assert_eq!(M.column(1).as_slice(), [2.0, 5.0]);
    assert_eq!(M.row(1).iter().sum::<f64>(), 15.0);
    assert_eq!(M.view((0, 1), (2, 2)), dmatrix![2.0, 3.0; 5.0, 6.0]);
    assert_eq!(&M * M.transpose(), &numbers * numbers.transpose());
    assert_eq!(&M + &numbers, 2.0 * &numbers);
    M.swap_columns(0, 2);
    M.swap_rows(0, 1);
    M.as_mut_slice()[0] = 7.0;
    M.column_mut(1).fill(8.0);
    assert_eq!(M, dmatrix![7.0, 8.0, 4.0; 3.0, 8.0, 1.0]);
    let copy = M.clone();
    M.fill(0.0);
    assert_eq!(copy.into_owned(), dmatrix![7.0, 8.0, 4.0; 3.0, 8.0, 1.0]);
}

#[test]
fn matrices_may_be_empty() {
    for (rows, columns) in [(0, 0), (0, 3), (3, 0)] {
        let M: Matrix<f64> = matrix(rows, columns, 1.0);
        assert_eq!((M.shape(), M.len(), M.clone_owned()), ((rows, columns), 0, DMatrix::zeros(rows, columns)));
    }
}

/// Checks that a matrix forgets its entries without dropping them. Some functions of nalgebra need this: they move
/// entries out one by one.
#[test]
fn matrices_forget_their_elements() {
    let owner = Rc::new(0);
    let M = matrix(2, 2, owner.clone());
    let taken: Vec<Rc<i32>> = M.iter().map(|x| unsafe { core::ptr::read(x) }).collect();
    M.data.forget_elements();
    assert_eq!(Rc::strong_count(&owner), 5);
    drop(taken);
    assert_eq!(Rc::strong_count(&owner), 1);
    assert!(matrix(1, 1, 0.0).data.is_contiguous());
}
